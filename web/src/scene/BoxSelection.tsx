import { useThree } from "@react-three/fiber";
import { useEffect } from "react";
import type { PerspectiveCamera } from "three";
import { selectGroup, toggleSelected } from "../state/vehicles.ts";
import { pickUav, uavsWithin } from "./stage/picking.ts";

const CLICK_PX = 5;

/** With Ctrl or Cmd, dragging a box selects the UAVs in it, and a click adds or removes one. */
export function BoxSelection() {
  const { camera, gl } = useThree();
  useEffect(() => {
    const canvas = gl.domElement;
    const box = document.createElement("div");
    box.className = "selection-box";
    let from: { x: number; y: number } | null = null;
    const at = (event: PointerEvent) => {
      const { left, top } = canvas.getBoundingClientRect();
      return { x: event.clientX - left, y: event.clientY - top };
    };
    const down = (event: PointerEvent) => {
      if (event.target !== canvas || event.button !== 0) return;
      if (!event.ctrlKey && !event.metaKey) return;
      event.stopPropagation();
      event.preventDefault();
      canvas.setPointerCapture(event.pointerId);
      from = at(event);
      draw(box, from, from);
      canvas.parentElement!.append(box);
    };
    const move = (event: PointerEvent) => {
      if (from === null) return;
      event.stopPropagation();
      draw(box, from, at(event));
    };
    const up = (event: PointerEvent) => {
      if (from === null) return;
      event.stopPropagation();
      const [begun, ended] = [from, at(event)];
      from = null;
      box.remove();
      if (event.type !== "pointerup") return;
      const size = { width: canvas.clientWidth, height: canvas.clientHeight };
      const eye = camera as PerspectiveCamera;
      if (Math.hypot(ended.x - begun.x, ended.y - begun.y) > CLICK_PX) {
        selectGroup(uavsWithin(begun, ended, eye, size));
        return;
      }
      const name = pickUav(ended.x, ended.y, eye, size);
      if (name !== "") toggleSelected(name);
    };
    // Before the views, which would turn.
    const options = { capture: true };
    window.addEventListener("pointerdown", down, options);
    window.addEventListener("pointermove", move, options);
    window.addEventListener("pointerup", up, options);
    window.addEventListener("pointercancel", up, options);
    return () => {
      box.remove();
      window.removeEventListener("pointerdown", down, options);
      window.removeEventListener("pointermove", move, options);
      window.removeEventListener("pointerup", up, options);
      window.removeEventListener("pointercancel", up, options);
    };
  }, [camera, gl]);
  return null;
}

interface Corner {
  x: number;
  y: number;
}

function draw({ style }: HTMLElement, a: Corner, b: Corner): void {
  style.left = `${Math.min(a.x, b.x)}px`;
  style.top = `${Math.min(a.y, b.y)}px`;
  style.width = `${Math.abs(a.x - b.x)}px`;
  style.height = `${Math.abs(a.y - b.y)}px`;
}
