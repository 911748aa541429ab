import { useRef, useState, type PointerEvent } from "react";

const RADIUS_PX = 56;

interface StickProps {
  label: string;
  /** Deflection to the right and downwards, each -1..1. */
  onMove: (x: number, y: number) => void;
}

/** A stick for a thumb. */
export function Stick({ label, onMove }: StickProps) {
  const box = useRef<HTMLDivElement>(null);
  const [at, setAt] = useState<[number, number]>([0, 0]);
  const move = (event: PointerEvent<HTMLDivElement>) => {
    if (!event.currentTarget.hasPointerCapture(event.pointerId)) return;
    const { left, top } = box.current!.getBoundingClientRect();
    const x = (event.clientX - left) / RADIUS_PX - 1;
    const y = (event.clientY - top) / RADIUS_PX - 1;
    const length = Math.max(1, Math.hypot(x, y));
    setAt([x / length, y / length]);
    onMove(x / length, y / length);
  };
  const release = () => {
    setAt([0, 0]);
    onMove(0, 0);
  };
  return (
    <div
      ref={box}
      className="stick"
      role="application"
      aria-label={label}
      style={{ width: 2 * RADIUS_PX, height: 2 * RADIUS_PX }}
      onPointerDown={(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        move(event);
      }}
      onPointerMove={move}
      onPointerUp={release}
      onPointerCancel={release}
    >
      <div
        className="stick-knob"
        style={{ transform: `translate(${at[0] * RADIUS_PX}px, ${at[1] * RADIUS_PX}px)` }}
      />
    </div>
  );
}
