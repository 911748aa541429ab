import { useFrame, useThree } from "@react-three/fiber";
import { useEffect, useMemo, useRef, useState } from "react";
import { Group, Raycaster, Vector2, type Object3D } from "three";
import { onLevel, onUpright, type Ray } from "../lib/dragging.ts";
import { Latest } from "../lib/latest.ts";
import { putAt, type Position } from "../link/commands.ts";
import { link } from "../link/link.ts";
import { succeeds } from "../state/notices.ts";
import { useWhyNot } from "../state/rights.ts";
import { useTool } from "../state/tool.ts";
import { baseFrame, useVehicles } from "../state/vehicles.ts";
import { rayAt } from "./rayAt.ts";

/** Twenty times a second are as smooth as the motion that is shown. */
const SEND_MS = 50;
/** Handles are as large as that share of their distance. */
const SHARE = 0.09;
const MIN_SCALE = 0.5;

type Grip = "level" | "upright";

/** Handles of the selected UAV: a ring that moves it level, arrows that lift and lower it. */
export function DragHandle() {
  const moving = useTool((tool) => tool.moving);
  const uav = useVehicles((vehicles) => vehicles.selected);
  const whyNot = useWhyNot();
  if (!moving || uav === "" || whyNot !== null) return null;
  return <Handle key={uav} uav={uav} />;
}

function Handle({ uav }: { uav: string }) {
  const group = useRef<Group>(null);
  const wished = useRef<Position | null>(null);
  const [held, setHeld] = useState<Grip | null>(null);
  useFollowing(group, uav, wished);
  useDragging(group, uav, wished, setHeld);
  return (
    <group ref={group} renderOrder={10}>
      <mesh name="level">
        <torusGeometry args={[1, 0.055, 10, 56]} />
        <HandleMaterial color="#22b8cf" held={held === "level"} />
      </mesh>
      <Arrow up held={held === "upright"} />
      <Arrow up={false} held={held === "upright"} />
      {/* Wide invisible grips: thin handles are hard to hit. */}
      <mesh name="level" visible={false}>
        <torusGeometry args={[1, 0.2, 6, 28]} />
      </mesh>
    </group>
  );
}

function Arrow({ up, held }: { up: boolean; held: boolean }) {
  const sign = up ? 1 : -1;
  return (
    <group rotation={[(sign * Math.PI) / 2, 0, 0]}>
      <mesh name="upright" position={[0, 0.7, 0]}>
        <cylinderGeometry args={[0.035, 0.035, 0.7, 10]} />
        <HandleMaterial color="#fab005" held={held} />
      </mesh>
      <mesh name="upright" position={[0, 1.2, 0]}>
        <coneGeometry args={[0.13, 0.32, 16]} />
        <HandleMaterial color="#fab005" held={held} />
      </mesh>
      <mesh name="upright" position={[0, 0.9, 0]} visible={false}>
        <cylinderGeometry args={[0.22, 0.22, 1, 8]} />
      </mesh>
    </group>
  );
}

function HandleMaterial({ color, held }: { color: string; held: boolean }) {
  return (
    <meshBasicMaterial
      color={held ? "#ffffff" : color}
      transparent
      opacity={0.9}
      depthTest={false}
      fog={false}
      toneMapped={false}
    />
  );
}

/** The handle is where the UAV is, or is wished to be, and of the same size on the screen. */
function useFollowing(
  group: React.RefObject<Group | null>,
  uav: string,
  wished: React.RefObject<Position | null>,
): void {
  useFrame(({ camera }) => {
    const handle = group.current;
    const pose = link.frames.pose(baseFrame(uav));
    if (handle === null) return;
    handle.visible = pose !== null;
    if (pose === null) return;
    const at = wished.current;
    handle.position.set(at?.x ?? pose[0], at?.y ?? pose[1], at?.z ?? pose[2]);
    const { x, y, z } = handle.position;
    const eye = camera.matrixWorld.elements;
    const distance = Math.hypot(eye[12]! - x, eye[13]! - y, eye[14]! - z);
    handle.scale.setScalar(Math.max(MIN_SCALE, distance * SHARE));
  });
}

/** Listens before the views do, so that they do not turn while a handle is held. */
function useDragging(
  group: React.RefObject<Group | null>,
  uav: string,
  wished: React.RefObject<Position | null>,
  setHeld: (grip: Grip | null) => void,
): void {
  const { camera, gl } = useThree();
  const caster = useMemo(() => new Raycaster(), []);
  useEffect(() => {
    const canvas = gl.domElement;
    const sender = new Latest<Position>(async (position) => {
      const pose = link.frames.pose(baseFrame(uav));
      const [, , , x = 0, y = 0, z = 0, w = 1] = pose ?? [];
      await succeeds(`Move ${uav}`, putAt(uav, position, { x, y, z, w }));
    }, SEND_MS);
    let drag: { grip: Grip; from: Position; offset: [number, number, number] } | null = null;
    const ray = (event: PointerEvent) => rayAt(canvas, camera, event.clientX, event.clientY);
    const down = (event: PointerEvent) => {
      if (event.target !== canvas || event.button !== 0 || group.current === null) return;
      if (event.ctrlKey || event.metaKey) return; // a box begins
      const grip = gripAt(caster, canvas, camera, group.current, event);
      if (grip === null) return;
      event.stopPropagation();
      event.preventDefault();
      const { x, y, z } = group.current.position;
      const from = { x, y, z };
      drag = { grip, from, offset: [0, 0, 0] };
      const start = positionOf(drag, ray(event));
      if (start !== null) drag.offset = [x - start.x, y - start.y, z - start.z];
      canvas.setPointerCapture(event.pointerId);
      setHeld(grip);
    };
    const move = (event: PointerEvent) => {
      if (drag === null) return;
      event.stopPropagation();
      const position = positionOf(drag, ray(event));
      if (position === null) return;
      wished.current = position;
      sender.offer(position);
    };
    const up = (event: PointerEvent) => {
      if (drag === null) return;
      event.stopPropagation();
      drag = null;
      setHeld(null);
      // From here on the handle is where the simulation has put the UAV.
      setTimeout(() => (wished.current = null), 300);
    };
    const options = { capture: true };
    window.addEventListener("pointerdown", down, options);
    window.addEventListener("pointermove", move, options);
    window.addEventListener("pointerup", up, options);
    window.addEventListener("pointercancel", up, options);
    return () => {
      window.removeEventListener("pointerdown", down, options);
      window.removeEventListener("pointermove", move, options);
      window.removeEventListener("pointerup", up, options);
      window.removeEventListener("pointercancel", up, options);
    };
  }, [camera, caster, gl, group, setHeld, uav, wished]);
}

function positionOf(
  drag: { grip: Grip; from: Position; offset: [number, number, number] },
  ray: Ray,
): Position | null {
  const { grip, from, offset } = drag;
  if (grip === "level") {
    const at = onLevel(ray, from.z);
    return at === null ? null : { x: at[0] + offset[0], y: at[1] + offset[1], z: from.z };
  }
  const z = onUpright(ray, from.x, from.y);
  return z === null ? null : { ...from, z: z + offset[2] };
}

function gripAt(
  caster: Raycaster,
  canvas: HTMLElement,
  camera: Parameters<Raycaster["setFromCamera"]>[1],
  handle: Object3D,
  event: PointerEvent,
): Grip | null {
  const box = canvas.getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * 2 - 1;
  const y = 1 - ((event.clientY - box.top) / box.height) * 2;
  caster.setFromCamera(new Vector2(x, y), camera);
  const [hit] = caster.intersectObject(handle, true);
  return (hit?.object.name as Grip | undefined) ?? null;
}
