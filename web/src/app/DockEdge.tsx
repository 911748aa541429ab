import type { KeyboardEvent, PointerEvent } from "react";
import { MIN_SIZE, resizeDock, useLayout, type Dock } from "../state/layout.ts";

const STEP_PX = 24;

/** The edge of a dock towards the scene: drag it, or use the arrow keys. */
export function DockEdge({ dock, title }: { dock: Dock; title: string }) {
  const size = useLayout((layout) => layout.sizes[dock]);
  const upright = dock !== "bottom";
  const drag = (event: PointerEvent<HTMLDivElement>) => {
    if (!event.currentTarget.hasPointerCapture(event.pointerId)) return;
    resizeDock(dock, sizeAt(dock, event));
  };
  const key = (event: KeyboardEvent) => {
    const growing = { left: "ArrowRight", right: "ArrowLeft", bottom: "ArrowUp" }[dock];
    const shrinking = { left: "ArrowLeft", right: "ArrowRight", bottom: "ArrowDown" }[dock];
    if (event.key === growing) resizeDock(dock, size + STEP_PX);
    else if (event.key === shrinking) resizeDock(dock, size - STEP_PX);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      className="dock-edge"
      role="separator"
      tabIndex={0}
      aria-label={`Size of ${title}`}
      aria-orientation={upright ? "vertical" : "horizontal"}
      aria-valuenow={size}
      aria-valuemin={MIN_SIZE[dock]}
      onPointerDown={(event) => event.currentTarget.setPointerCapture(event.pointerId)}
      onPointerMove={drag}
      onKeyDown={key}
    />
  );
}

function sizeAt(dock: Dock, event: PointerEvent<HTMLDivElement>): number {
  const box = event.currentTarget.parentElement!.getBoundingClientRect();
  if (dock === "left") return event.clientX - box.left;
  if (dock === "right") return box.right - event.clientX;
  return box.bottom - event.clientY;
}
