import { useRef, type KeyboardEvent, type PointerEvent } from "react";
import { closePanel, resizeSheet, useLayout, type Slot } from "../state/layout.ts";

const STEP_PX = 40;

/** The upper edge of a phone's sheet: drag it up or down; at the foot of the page it closes. */
export function SheetHandle({ slot, title }: { slot: Slot; title: string }) {
  const size = useLayout((layout) => layout.sheet);
  const box = useRef<HTMLDivElement>(null);
  const height = () => box.current?.parentElement?.offsetHeight ?? size;
  const drag = (event: PointerEvent<HTMLDivElement>) => {
    if (!event.currentTarget.hasPointerCapture(event.pointerId)) return;
    const { bottom } = event.currentTarget.parentElement!.getBoundingClientRect();
    resizeSheet(slot, bottom - event.clientY);
  };
  const key = (event: KeyboardEvent) => {
    if (event.key === "ArrowUp") resizeSheet(slot, height() + STEP_PX);
    else if (event.key === "ArrowDown") resizeSheet(slot, height() - STEP_PX);
    else if (event.key === "Escape") closePanel(slot);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      ref={box}
      className="sheet-handle"
      role="separator"
      tabIndex={0}
      aria-label={`Height of ${title}`}
      aria-orientation="horizontal"
      aria-valuenow={size}
      onPointerDown={(event) => event.currentTarget.setPointerCapture(event.pointerId)}
      onPointerMove={drag}
      onKeyDown={key}
    />
  );
}
