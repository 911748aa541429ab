import type { KeyboardEvent, PointerEvent } from "react";
import { splitBottom, useLayout } from "../state/layout.ts";

const STEP = 0.04;

/** The border of the two halves of the bottom: drag it, or use the arrow keys. */
export function SplitEdge({ left, right }: { left: string; right: string }) {
  const split = useLayout((layout) => layout.split);
  const drag = (event: PointerEvent<HTMLDivElement>) => {
    if (!event.currentTarget.hasPointerCapture(event.pointerId)) return;
    const box = halvesOf(event.currentTarget);
    splitBottom((event.clientX - box.left) / box.width, box.width);
  };
  const key = (event: KeyboardEvent<HTMLDivElement>) => {
    const step = { ArrowLeft: -STEP, ArrowRight: STEP }[event.key];
    if (step === undefined) return;
    splitBottom(split + step, halvesOf(event.currentTarget).width);
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      className="split-edge"
      role="separator"
      tabIndex={0}
      aria-label={`Border of ${left} and ${right}`}
      aria-orientation="vertical"
      aria-valuenow={Math.round(100 * split)}
      aria-valuemin={0}
      aria-valuemax={100}
      onPointerDown={(event) => event.currentTarget.setPointerCapture(event.pointerId)}
      onPointerMove={drag}
      onKeyDown={key}
    />
  );
}

function halvesOf(edge: HTMLElement): DOMRect {
  return edge.closest(".halves")!.getBoundingClientRect();
}
