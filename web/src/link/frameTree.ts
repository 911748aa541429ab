import type { geometry_msgs_TransformStamped } from "../messages/generated.ts";
import { compose, identity, type Pose } from "../lib/pose.ts";
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
  /** Places told straight in the map by the simulation; they win over estimates. */
  private readonly true_ = new Map<string, Pose>();

  move(transforms: readonly geometry_msgs_TransformStamped[]): void {
    for (const t of transforms) {
      const child = bare(t.child_frame_id);
      if (!this.moving.has(child) && !this.true_.has(child)) this.version++;
      this.moving.set(child, { parent: bare(t.header.frame_id), pose: poseOf(t) });
    }
  }

  fix(transforms: readonly geometry_msgs_TransformStamped[]): void {
    for (const t of transforms) {
      this.fixed.set(bare(t.child_frame_id), { parent: bare(t.header.frame_id), pose: poseOf(t) });
    }
    this.version++;
  }

  /** Take one message with the true places of everything; what it lacks is gone. */
  moveTruly(transforms: readonly geometry_msgs_TransformStamped[]): void {
    const told = new Set<string>();
    for (const t of transforms) {
      const child = bare(t.child_frame_id);
      told.add(child);
      if (!this.true_.has(child)) this.version++;
      this.true_.set(child, poseOf(t));
    }
    if (told.size === this.true_.size) return;
    for (const name of this.true_.keys()) {
      if (told.has(name)) continue;
      this.true_.delete(name);
      this.moving.delete(name);
      this.version++;
    }
  }

  forget(): void {
    this.moving.clear();
    this.fixed.clear();
    this.true_.clear();
    this.version++;
  }

  names(): FrameNames {
    const names = new Set([...this.true_.keys(), ...this.moving.keys()]);
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
      const pose = this.inMap(name, 0);
      if (pose === null) rows.fill(NaN, i * POSE, (i + 1) * POSE);
      else rows.set(pose, i * POSE);
    });
    return rows;
  }

  private inMap(frame: string, depth: number): Pose | null {
    const known = this.true_.get(frame);
    if (known !== undefined) return known;
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

function poseOf(t: geometry_msgs_TransformStamped): Pose {
  const { translation: p, rotation: q } = t.transform;
  return [p.x, p.y, p.z, q.x, q.y, q.z, q.w];
}
