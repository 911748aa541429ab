// `window.volery`: what tests and the benchmark read of the running scene. Nothing in the page
// depends on it.

import type { PerspectiveCamera, WebGLRenderer } from "three";
import { Vector3 } from "three";

export interface OnScreen {
  name: string;
  /** CSS pixels from the scene's top left corner. */
  x: number;
  y: number;
  /** Whether it is in front of the camera and within the view. */
  visible: boolean;
  /** Map, m. */
  position: [number, number, number];
}

export interface Debugging {
  /** Frames drawn since the page was opened. */
  frames: number;
  /** Draw calls and triangles of the last frame, shadows included. */
  drawCalls: number;
  triangles: number;
  /** JavaScript of the last frame, ms: `updateMs` until everything is updated, then the calls to WebGL. */
  scriptMs: number;
  updateMs: number;
  /** Time between the last two frames, ms. */
  frameMs: number;
  /** `performance.now()` when the first frame with the world in it was drawn; 0: none yet. */
  firstRenderMs: number;
  /** What the last frame's work went to, ms by part; only while `detailed` is set. */
  parts: Record<string, number>;
  detailed: boolean;
  quality: string;
  camera: {
    position: [number, number, number];
    quaternion: [number, number, number, number];
    fov: number;
  };
  /** UAVs on the screen. */
  uavs: () => OnScreen[];
  /** Segments of a UAV's trail. */
  trailLength: (uav: string) => number;
  /** Height of the ground, map, m. */
  groundAt: (x: number, y: number) => number;
}

declare global {
  interface Window {
    volery: Debugging;
  }
}

export const debugging: Debugging = {
  frames: 0,
  drawCalls: 0,
  triangles: 0,
  scriptMs: 0,
  updateMs: 0,
  frameMs: 0,
  firstRenderMs: 0,
  parts: {},
  detailed: false,
  quality: "",
  camera: { position: [0, 0, 0], quaternion: [0, 0, 0, 1], fov: 0 },
  uavs: () => [],
  trailLength: () => 0,
  groundAt: () => 0,
};

const point = new Vector3();

/** Where a position in the map is on the screen. */
export function onScreen(
  name: string,
  position: [number, number, number],
  camera: PerspectiveCamera,
  width: number,
  height: number,
): OnScreen {
  point.set(...position).project(camera);
  return {
    name,
    x: (0.5 + 0.5 * point.x) * width,
    y: (0.5 - 0.5 * point.y) * height,
    visible: Math.abs(point.x) <= 1 && Math.abs(point.y) <= 1 && Math.abs(point.z) <= 1,
    position,
  };
}

/** After a frame was drawn. */
export function noteFrame(renderer: WebGLRenderer, camera: PerspectiveCamera): void {
  debugging.frames++;
  debugging.drawCalls = renderer.info.render.calls;
  debugging.triangles = renderer.info.render.triangles;
  debugging.camera.position = camera.position.toArray();
  debugging.camera.quaternion = camera.quaternion.toArray() as [number, number, number, number];
  debugging.camera.fov = camera.fov;
}
