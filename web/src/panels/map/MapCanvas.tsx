import { useEffect, useRef, type KeyboardEvent, type PointerEvent, type RefObject } from "react";
import {
  panned,
  pixelOf,
  positionOf,
  zoomed,
  type MapView,
  type Size,
} from "../../lib/mapProjection.ts";
import { link } from "../../link/link.ts";
import { POSE } from "../../link/protocol.ts";
import { sendAllAbove } from "../../state/goals.ts";
import { givePosition, useTool } from "../../state/tool.ts";
import {
  allSelected,
  baseFrame,
  select,
  toggleSelected,
  useVehicles,
} from "../../state/vehicles.ts";
import { heightAt } from "../../state/worldPlan.ts";

const WHEEL = 1.0015;
const CLICK_PX = 4;
const GRAB_PX = 14;
const KEY_PAN_PX = 40;

interface MapCanvasProps {
  canvas: RefObject<HTMLCanvasElement | null>;
  /** What is shown now. */
  shown: RefObject<MapView | null>;
  move: (next: (view: MapView) => MapView) => void;
  stopFollowing: () => void;
  clickSends: boolean;
}

/** The canvas of the map, and what hands do on it: pan, zoom, click. */
export function MapCanvas({ canvas, shown, move, stopFollowing, clickSends }: MapCanvasProps) {
  const pressed = useRef<{ x: number; y: number; dragged: boolean } | null>(null);
  const asking = useTool((tool) => tool.asking !== null);
  const sizeOf = (element: HTMLElement) => ({
    width: element.clientWidth,
    height: element.clientHeight,
  });
  const zoom = (element: HTMLElement, factor: number, px: number, py: number) =>
    move((now) => zoomed(now, sizeOf(element), factor, px, py));
  useWheel(canvas, (event) =>
    zoom(event.currentTarget as HTMLElement, WHEEL ** -event.deltaY, event.offsetX, event.offsetY),
  );
  const down = (event: PointerEvent<HTMLCanvasElement>) => {
    event.currentTarget.setPointerCapture(event.pointerId);
    pressed.current = { x: event.clientX, y: event.clientY, dragged: false };
  };
  const drag = (event: PointerEvent<HTMLCanvasElement>) => {
    const from = pressed.current;
    if (from === null) return;
    const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
    if (!from.dragged && Math.hypot(dx, dy) < CLICK_PX) return;
    pressed.current = { x: event.clientX, y: event.clientY, dragged: true };
    stopFollowing();
    move((now) => panned(now, dx, dy));
  };
  const up = (event: PointerEvent<HTMLCanvasElement>) => {
    const from = pressed.current;
    pressed.current = null;
    if (from === null || from.dragged || shown.current === null) return;
    const { left, top } = event.currentTarget.getBoundingClientRect();
    const size = sizeOf(event.currentTarget);
    click(shown.current, size, {
      px: event.clientX - left,
      py: event.clientY - top,
      more: event.ctrlKey || event.metaKey,
      sends: clickSends,
    });
  };
  const key = (event: KeyboardEvent<HTMLCanvasElement>) => {
    const element = event.currentTarget;
    const [x, y] = [element.clientWidth / 2, element.clientHeight / 2];
    const moves: Record<string, () => void> = {
      ArrowLeft: () => move((now) => panned(now, KEY_PAN_PX, 0)),
      ArrowRight: () => move((now) => panned(now, -KEY_PAN_PX, 0)),
      ArrowUp: () => move((now) => panned(now, 0, KEY_PAN_PX)),
      ArrowDown: () => move((now) => panned(now, 0, -KEY_PAN_PX)),
      "+": () => zoom(element, 1.4, x, y),
      "-": () => zoom(element, 1 / 1.4, x, y),
    };
    const run = moves[event.key];
    if (run === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    stopFollowing();
    run();
  };
  return (
    <canvas
      ref={canvas}
      className="map-canvas"
      role="application"
      tabIndex={0}
      aria-label="Map: arrow keys move it, + and - zoom"
      data-asks={asking || clickSends || undefined}
      onPointerDown={down}
      onPointerMove={drag}
      onPointerUp={up}
      onKeyDown={key}
    />
  );
}

interface Click {
  px: number;
  py: number;
  /** Whether a clicked UAV joins those that are selected. */
  more: boolean;
  /** Whether a click beside UAVs sends the selected ones there. */
  sends: boolean;
}

/** A UAV that is clicked is selected; elsewhere the position is taken. */
function click(view: MapView, size: Size, { px, py, more, sends }: Click): void {
  const [x, y] = positionOf(view, size, px, py);
  if (useTool.getState().asking !== null) return givePosition({ x, y, z: heightAt(x, y) });
  const hit = useVehicles.getState().list.find(({ name }) => {
    const row = link.frames.row(baseFrame(name));
    if (row < 0) return false;
    const [ux, uy] = link.frames.now.subarray(row * POSE, row * POSE + 2);
    const [ax, ay] = pixelOf(view, size, ux!, uy!);
    return Math.hypot(ax - px, ay - py) < GRAB_PX;
  });
  if (hit !== undefined) (more ? toggleSelected : select)(hit.name);
  else if (sends && allSelected().length > 0) void sendAllAbove(allSelected(), { x, y });
}

/** React's own wheel listeners cannot keep the page from scrolling. */
function useWheel(
  canvas: RefObject<HTMLCanvasElement | null>,
  turn: (event: WheelEvent) => void,
): void {
  const latest = useRef(turn);
  latest.current = turn;
  useEffect(() => {
    const element = canvas.current;
    if (element === null) return;
    const listen = (event: WheelEvent) => {
      event.preventDefault();
      latest.current(event);
    };
    element.addEventListener("wheel", listen, { passive: false });
    return () => element.removeEventListener("wheel", listen);
  }, [canvas]);
}
