import { isFlightKey } from "../lib/twist.ts";
import { useFlying } from "../state/flying.ts";

/** What hands did since the last frame; a view takes what it understands. */
export interface Input {
  /** Turned by dragging, CSS pixels. */
  turnX: number;
  turnY: number;
  /** Moved by dragging with the right button, with shift or with two fingers. */
  panX: number;
  panY: number;
  /** Zoomed: above 1 farther away. */
  zoom: number;
  /** Keys that are held down, by `event.code`. */
  readonly held: ReadonlySet<string>;
}

const CLICK_PX = 5;
const DOUBLE_MS = 350;

export interface Clicks {
  click: (x: number, y: number) => void;
  doubleClick: (x: number, y: number) => void;
  hover: (x: number, y: number) => void;
  leave: () => void;
}

/** Mouse, fingers, pen and wheel on the scene, and the keys that move a walker. */
export class Hands implements Input {
  turnX = 0;
  turnY = 0;
  panX = 0;
  panY = 0;
  zoom = 1;
  readonly held = new Set<string>();
  /** Whether anything was done since the last `rest`. */
  busy = false;

  private readonly fingers = new Map<number, { x: number; y: number; button: number }>();
  private start = { x: 0, y: 0, moved: false };
  private clickedMs = -Infinity;
  private readonly ended = new AbortController();

  constructor(
    private readonly element: HTMLElement,
    private readonly clicks: Clicks,
  ) {
    const options = { signal: this.ended.signal };
    element.addEventListener("pointerdown", this.down, options);
    element.addEventListener("pointermove", this.move, options);
    element.addEventListener("pointerup", this.up, options);
    element.addEventListener("pointercancel", this.cancel, options);
    element.addEventListener("pointerleave", () => clicks.leave(), options);
    element.addEventListener("wheel", this.wheel, { ...options, passive: false });
    element.addEventListener("contextmenu", (event) => event.preventDefault(), options);
    window.addEventListener("keydown", this.press, options);
    window.addEventListener("keyup", (event) => this.held.delete(event.code), options);
    window.addEventListener("blur", () => this.held.clear(), options);
    element.style.touchAction = "none";
  }

  /** Forget what was done: the frame has taken it. */
  rest(): void {
    this.turnX = this.turnY = this.panX = this.panY = 0;
    this.zoom = 1;
    this.busy = this.held.size > 0;
  }

  dispose(): void {
    this.ended.abort();
  }

  private readonly down = (event: PointerEvent): void => {
    this.element.focus({ preventScroll: true });
    this.element.setPointerCapture?.(event.pointerId);
    if (this.fingers.size === 0) this.start = { x: event.clientX, y: event.clientY, moved: false };
    this.fingers.set(event.pointerId, {
      x: event.clientX,
      y: event.clientY,
      button: event.shiftKey ? 2 : event.button,
    });
  };

  private readonly move = (event: PointerEvent): void => {
    const finger = this.fingers.get(event.pointerId);
    if (finger === undefined) {
      const { x, y } = this.onCanvas(event);
      this.clicks.hover(x, y);
      return;
    }
    const [dx, dy] = [event.clientX - finger.x, event.clientY - finger.y];
    if (Math.hypot(event.clientX - this.start.x, event.clientY - this.start.y) > CLICK_PX)
      this.start.moved = true;
    const spreadBefore = this.spread();
    finger.x = event.clientX;
    finger.y = event.clientY;
    if (!this.start.moved) return;
    this.busy = true;
    if (this.fingers.size >= 2) {
      // Each finger gives its own half of what both do.
      this.panX += dx / 2;
      this.panY += dy / 2;
      const spread = this.spread();
      if (spreadBefore > 1 && spread > 1) this.zoom *= spreadBefore / spread;
    } else if (finger.button === 0) {
      this.turnX += dx;
      this.turnY += dy;
    } else {
      this.panX += dx;
      this.panY += dy;
    }
  };

  private readonly up = (event: PointerEvent): void => {
    const finger = this.fingers.get(event.pointerId);
    this.fingers.delete(event.pointerId);
    if (finger === undefined || this.start.moved || finger.button !== 0 || this.fingers.size > 0)
      return;
    const { x, y } = this.onCanvas(event);
    const double = event.timeStamp - this.clickedMs < DOUBLE_MS;
    this.clickedMs = double ? -Infinity : event.timeStamp;
    if (double) this.clicks.doubleClick(x, y);
    else this.clicks.click(x, y);
  };

  private readonly cancel = (event: PointerEvent): void => {
    this.fingers.delete(event.pointerId);
  };

  private readonly wheel = (event: WheelEvent): void => {
    event.preventDefault();
    this.busy = true;
    const pixels = event.deltaMode === 1 ? 16 * event.deltaY : event.deltaY;
    this.zoom *= Math.exp(0.0011 * Math.max(-400, Math.min(400, pixels)));
  };

  private readonly press = (event: KeyboardEvent): void => {
    if (isTyping(event)) return;
    if (event.code.startsWith("Arrow") && !this.isFocused()) return; // they belong to the panels
    this.held.add(event.code);
    this.busy = true;
  };

  private isFocused(): boolean {
    const { activeElement } = document;
    return activeElement === document.body || activeElement === this.element;
  }

  private spread(): number {
    const [a, b] = [...this.fingers.values()];
    return a === undefined || b === undefined ? 0 : Math.hypot(a.x - b.x, a.y - b.y);
  }

  private onCanvas(event: PointerEvent): { x: number; y: number } {
    const { left, top } = this.element.getBoundingClientRect();
    return { x: event.clientX - left, y: event.clientY - top };
  }
}

/** Whether a key is meant for something else: a field, a shortcut, a listener that took it already. */
export function isTyping(event: KeyboardEvent): boolean {
  if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return true;
  // In manual control those keys are the UAV's.
  if (useFlying.getState().uav !== "" && isFlightKey(event.code)) return true;
  const target = event.target as HTMLElement | null;
  return (
    target?.closest?.("input, textarea, select, [contenteditable=true], [role=dialog]") != null
  );
}
