// Messages between the page and its worker. The worker owns the connection.

import type { StreamOrder } from "./streams.ts";

export type LinkState = "connecting" | "open" | "lost" | "refused";

export interface Wish {
  /** What to receive. */
  topic: string;
  /** Type as `sensor_msgs/msg/LaserScan`. */
  type: string;
  /** Minimum time between two messages, ms; 0: every message. */
  throttleMs: number;
  /** How many wait at the server for a slow page before the oldest is dropped. */
  depth: number;
}

export type ToWorker =
  | { kind: "connect"; url: string }
  | ({ kind: "subscribe"; id: number } & Wish)
  | { kind: "unsubscribe"; id: number }
  | { kind: "call"; id: number; service: string; type: string; request: unknown; timeoutS: number }
  | { kind: "publish"; topic: string; type: string; message: unknown }
  | ({ kind: "stream" } & StreamOrder)
  | { kind: "endStream"; topic: string }
  | { kind: "unadvertise"; topic: string }
  | { kind: "followFrames"; throttleMs: number; truth: boolean };

export type FromWorker =
  | { kind: "state"; state: LinkState; reason: string; url: string }
  | { kind: "message"; id: number; message: unknown; bytes: number; arrivedMs: number }
  | { kind: "answer"; id: number; ok: true; value: unknown }
  | { kind: "answer"; id: number; ok: false; reason: string }
  | ({ kind: "frames" } & FrameNames)
  | ({ kind: "poses" } & FramePoses)
  | { kind: "complaint"; text: string }
  | { kind: "traffic"; bytes: number; messages: number; arrivedMs: number };

/** Frames that move, in the order of the rows of `FramePoses`. */
export interface FrameNames {
  names: string[];
  /** Frames that stand still in another one: sensors on their UAV. */
  fixed: { child: string; parent: string; pose: number[] }[];
}

/** Where the frames are: rows of x y z qx qy qz qw in the map, m. */
export interface FramePoses {
  poses: Float64Array<ArrayBuffer>;
  /** Time of the newest transform, s. */
  stampS: number;
  /** When it arrived, as `performance.timeOrigin + performance.now()`, ms. */
  arrivedMs: number;
}

/** Numbers of one row of `FramePoses`. */
export const POSE = 7;
