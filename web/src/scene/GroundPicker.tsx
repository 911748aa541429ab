import { useThree } from "@react-three/fiber";
import { useEffect } from "react";
import { meetGround } from "../lib/heights.ts";
import { givePosition, useTool } from "../state/tool.ts";
import { heightAt } from "../state/worldPlan.ts";
import { rayAt } from "./rayAt.ts";

const CLICK_PX = 4;

/** While a position is requested, a click in the scene gives it; dragging looks around as ever. */
export function GroundPicker() {
  const asking = useTool((tool) => tool.asking !== null);
  const { camera, gl } = useThree();
  useEffect(() => {
    if (!asking) return;
    const canvas = gl.domElement;
    let pressed: [number, number] | null = null;
    const down = (event: PointerEvent) => {
      pressed = event.button === 0 ? [event.clientX, event.clientY] : null;
    };
    const up = (event: PointerEvent) => {
      const from = pressed;
      pressed = null;
      if (from === null) return;
      if (Math.hypot(event.clientX - from[0], event.clientY - from[1]) > CLICK_PX) return;
      const { origin, direction } = rayAt(canvas, camera, event.clientX, event.clientY);
      const point = meetGround(heightAt, origin, direction);
      if (point === null) return;
      event.stopPropagation();
      givePosition({ x: point[0], y: point[1], z: point[2] });
    };
    canvas.style.cursor = "crosshair";
    canvas.addEventListener("pointerdown", down);
    canvas.addEventListener("pointerup", up);
    return () => {
      canvas.style.cursor = "";
      canvas.removeEventListener("pointerdown", down);
      canvas.removeEventListener("pointerup", up);
    };
  }, [asking, camera, gl]);
  return null;
}
