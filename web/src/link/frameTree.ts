import type { geometry_msgs_TransformStamped } from "../messages/generated.ts";
import type { Transforms } from "../lib/cdrTransforms.ts";
import { compose, identity, type Pose } from "../lib/pose.ts";
import { secondsOf } from "../lib/time.ts";
import { POSE, type FrameNames } from "./protocol.ts";

const DEEPEST = 32;

interface Edge {
  parent: string;
  pose: Pose;
}

/** Transforms as they arrive, and where each moving frame is in the map. */
export class FrameTree {
  /** Grows whenever the set of frames changes. */
  version = 0;
  private readonly moving = new Map<string, Edge>();
  private readonly fixed = new Map<string, Edge>();
  /** Rows in `truePoses` of ground truth poses in the map; they win over estimates. */
  private trueRows = new Map<string, number>();
  private truePoses: Float64Array = new Float64Array(0);

  move({ parents, children, poses }: Transforms): void {
    for (let i = 0; i < children.length; i++) {
      const child = bare(children[i]!);
      if (!this.moving.has(child) && !this.trueRows.has(child)) this.version++;
      this.moving.set(child, { parent: bare(parents[i]!), pose: poseAt(poses, i) });
    }
  }

  fix({ parents, children, poses }: Transforms): void {
    children.forEach((child, i) =>
      this.fixed.set(bare(child), { parent: bare(parents[i]!), pose: poseAt(poses, i) }),
    );
    this.version++;
  }

  /** Take one message with the true poses of everything; what it lacks is gone. */
  moveTruly({ children, poses }: Transforms): void {
    this.truePoses = poses;
    const before = this.trueRows;
    const same =
      before.size === children.length && children.every((name, i) => before.get(bare(name)) === i);
    if (same) return;
    this.trueRows = new Map(children.map((name, i) => [bare(name), i]));
    for (const name of before.keys()) {
      if (!this.trueRows.has(name)) this.moving.delete(name);
    }
    this.version++;
  }

  forget(): void {
    this.moving.clear();
    this.fixed.clear();
    this.trueRows = new Map();
    this.version++;
  }

  names(): FrameNames {
    const names = new Set([...this.trueRows.keys(), ...this.moving.keys()]);
    const fixed = [...this.fixed].map(([child, { parent, pose }]) => ({
      child,
      parent,
      pose: [...pose],
    }));
    return { names: [...names], fixed };
  }

  /** Rows of `POSE` numbers for `names`; NaN where a frame hangs from nothing known. */
  rows(names: readonly string[]): Float64Array<ArrayBuffer> {
    const rows = new Float64Array(names.length * POSE);
    names.forEach((name, i) => {
      const row = this.trueRows.get(name);
      if (row !== undefined) {
        for (let k = 0; k < POSE; k++) rows[i * POSE + k] = this.truePoses[row * POSE + k]!;
        return;
      }
      const pose = this.inMap(name, 0);
      if (pose === null) rows.fill(NaN, i * POSE, (i + 1) * POSE);
      else rows.set(pose, i * POSE);
    });
    return rows;
  }

  private inMap(frame: string, depth: number): Pose | null {
    const row = this.trueRows.get(frame);
    if (row !== undefined) return poseAt(this.truePoses, row);
    if (frame === "map" || frame === "world") return identity();
    const edge = this.moving.get(frame) ?? this.fixed.get(frame);
    // A robot without a map shows itself in the topmost frame that it has.
    if (edge === undefined) return depth > 0 ? identity() : null;
    if (depth > DEEPEST) return null;
    const parent = this.inMap(edge.parent, depth + 1);
    return parent === null ? null : compose(parent, edge.pose);
  }
}

function bare(name: string): string {
  return name.startsWith("/") ? name.slice(1) : name;
}

function poseAt(poses: Float64Array, row: number): Pose {
  const p = poses;
  const at = row * POSE;
  return [p[at]!, p[at + 1]!, p[at + 2]!, p[at + 3]!, p[at + 4]!, p[at + 5]!, p[at + 6]!];
}

/** Transforms that came as objects. */
export function transformsOf(list: readonly geometry_msgs_TransformStamped[]): Transforms {
  const [first] = list;
  return {
    stampS: first === undefined ? NaN : secondsOf(first.header.stamp),
    parents: list.map(({ header }) => header.frame_id),
    children: list.map((each) => each.child_frame_id),
    poses: Float64Array.from(list.flatMap(poseOf)),
  };
}

function poseOf({ transform: { translation: p, rotation: q } }: geometry_msgs_TransformStamped) {
  return [p.x, p.y, p.z, q.x, q.y, q.z, q.w];
}
