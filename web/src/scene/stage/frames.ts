import { link } from "../../link/link.ts";
import type { Pose } from "../../lib/pose.ts";
import { toMap } from "./mapFrame.ts";

const AT_MAP: Readonly<Pose> = [0, 0, 0, 0, 0, 0, 1];

/** Pose of a frame; of an unknown one that of the map: better there than nowhere. */
export function frameOf(frame: string): Readonly<Pose> {
  const bare = frame.startsWith("/") ? frame.slice(1) : frame;
  return link.frames.pose(bare) ?? AT_MAP;
}

/** Positions given in a frame, three numbers each, in the map; what is no number is left out. */
export function inMap(
  frame: string,
  positions: readonly { x: number; y: number; z: number }[],
): Float64Array {
  const pose = frameOf(frame);
  const out: number[] = [];
  for (const position of positions) {
    const [x, y, z] = toMap(pose, position.x, position.y, position.z);
    if (Number.isFinite(x + y + z)) out.push(x, y, z);
  }
  return Float64Array.from(out);
}
