import { Matrix4, Quaternion, Vector3 } from "three";
import type { Frame } from "../lib/framing.ts";
import type { CameraPose } from "../state/view.ts";
import type { Input } from "./input.ts";

/** From where and how the scene is seen. */
export interface Eye {
  position: Vector3;
  quaternion: Quaternion;
  /** Vertical, degrees. */
  fov: number;
}

/** What a view may know of the world. */
export interface Surroundings {
  heightAt: (x: number, y: number) => number;
  /** Where a walker ends that moves from one position towards another. */
  walk: (from: readonly [number, number], to: readonly [number, number]) => [number, number];
  /** The selected UAV as it is shown; null: there is none. */
  uav: {
    name: string;
    position: Vector3;
    quaternion: Quaternion;
    /** From its middle to its farthest rotor, m. */
    radius: number;
  } | null;
  /** Camera of the selected UAV; null: it has none. */
  uavCamera: Eye | null;
  /** What encloses the selected UAV and those near it, m. */
  group: Frame;
  /** Width over height of the view. */
  aspect: number;
}

/** A kind of view of the scene. */
export interface Rig {
  /** Begin: at `eye`, where the view before was, or where a link says. */
  enter(eye: Eye, around: Surroundings, kept: CameraPose | null): void;
  /** Take what the hands did; `eye` becomes what is seen after another `stepS`. */
  update(input: Input, around: Surroundings, stepS: number, eye: Eye): void;
  /** What a link must say to come back here; null: nothing. */
  pose(): CameraPose | null;
  /** Look at the selected UAV. */
  focus?(around: Surroundings): void;
}

export const FOV = 55;
export const STEEPEST = Math.PI / 2 - 0.02;

const UP = new Vector3(0, 0, 1);
const ORIGIN = new Vector3();
const matrix = new Matrix4();
const direction = new Vector3();

/** Direction from heading (counter-clockwise from x) and pitch (up), rad. */
export function directionOf(yaw: number, pitch: number, out: Vector3): Vector3 {
  const level = Math.cos(pitch);
  return out.set(level * Math.cos(yaw), level * Math.sin(yaw), Math.sin(pitch));
}

/** Let a camera look along heading and pitch. */
export function lookAlong(yaw: number, pitch: number, out: Quaternion): void {
  directionOf(yaw, pitch, direction);
  out.setFromRotationMatrix(matrix.lookAt(ORIGIN, direction, UP));
}

export function lookFromTo(from: Vector3, to: Vector3, out: Quaternion): void {
  out.setFromRotationMatrix(matrix.lookAt(from, to, UP));
}

/** Heading and pitch in which a camera looks. */
export function headingOf(quaternion: Quaternion): { yaw: number; pitch: number } {
  direction.set(0, 0, -1).applyQuaternion(quaternion);
  return {
    yaw: Math.atan2(direction.y, direction.x),
    pitch: Math.asin(clamp(-1, direction.z, 1)),
  };
}

/** Fraction of a difference to remove in a step, for a decay with a time constant. */
export function easing(stepS: number, timeS: number): number {
  return 1 - Math.exp(-stepS / timeS);
}

export function clamp(low: number, x: number, high: number): number {
  return Math.min(high, Math.max(low, x));
}

/** Where keys push: forward, left, up, each -1 to 1. */
export function pushed(held: ReadonlySet<string>): [number, number, number] {
  const either = (...codes: string[]) => (codes.some((code) => held.has(code)) ? 1 : 0);
  return [
    either("KeyW", "ArrowUp") - either("KeyS", "ArrowDown"),
    either("KeyA", "ArrowLeft") - either("KeyD", "ArrowRight"),
    either("KeyE") - either("KeyQ"),
  ];
}

export function isFast(held: ReadonlySet<string>): boolean {
  return held.has("ShiftLeft") || held.has("ShiftRight");
}
