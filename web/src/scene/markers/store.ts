import { secondsOf } from "../../lib/time.ts";
import type { visualization_msgs_Marker } from "../../messages/generated.ts";

export const ADD = 0;
export const DELETE = 2;
export const DELETE_ALL = 3;

export interface Kept {
  marker: visualization_msgs_Marker;
  /** When its lifetime is over; Infinity: never. */
  untilMs: number;
}

/** Markers as visualization_msgs means them: by topic, namespace and id, each for its lifetime. */
export class MarkerStore {
  readonly kept = new Map<string, Kept>();
  /** Grows whenever a marker came, changed or went. */
  version = 0;

  take(topic: string, markers: readonly visualization_msgs_Marker[], nowMs: number): void {
    for (const marker of markers) {
      const key = `${topic} ${marker.ns} ${marker.id}`;
      if (marker.action === DELETE_ALL)
        this.forget(marker.ns === "" ? `${topic} ` : `${topic} ${marker.ns} `);
      else if (marker.action === DELETE) this.kept.delete(key);
      else this.kept.set(key, { marker, untilMs: endOf(marker, nowMs) });
    }
    this.version++;
  }

  /** Forget what has outlived its time. */
  expire(nowMs: number): void {
    for (const [key, { untilMs }] of this.kept) {
      if (untilMs > nowMs) continue;
      this.kept.delete(key);
      this.version++;
    }
  }

  /** Forget all markers whose keys begin so: those of a topic. */
  forget(prefix: string): void {
    for (const key of this.kept.keys()) if (key.startsWith(prefix)) this.kept.delete(key);
    this.version++;
  }
}

/** A lifetime of 0 never ends. */
function endOf({ lifetime }: visualization_msgs_Marker, nowMs: number): number {
  const seconds = lifetime === undefined ? 0 : secondsOf(lifetime);
  return seconds > 0 ? nowMs + 1000 * seconds : Infinity;
}
