import { compose, type Pose } from "../lib/pose.ts";
import { POSE, type FrameNames, type FramePoses } from "./protocol.ts";

const DEEPEST = 16;

/** Where every frame is in the map: what the frame loop reads, without a copy. */
export class Frames {
  /** Names of the rows. */
  names: string[] = [];
  /** Grows whenever `names` or what hangs on them changes. */
  version = 0;
  /** Rows of x y z qx qy qz qw of the newest and of the previous message. */
  now = new Float64Array(0);
  before = new Float64Array(0);
  /** Simulated times of the two, s. */
  stampS = 0;
  beforeStampS = 0;
  /** Wall times of their arrival, ms. */
  arrivedMs = 0;
  beforeArrivedMs = 0;

  private rows = new Map<string, number>();
  private fixed = new Map<string, { parent: string; pose: Pose }>();

  rename({ names, fixed }: FrameNames): void {
    this.names = names;
    this.rows = new Map(names.map((name, i) => [name, i]));
    this.fixed = new Map(
      fixed.map(({ child, parent, pose }) => [child, { parent, pose: pose as Pose }]),
    );
    this.version++;
    this.before = new Float64Array(0);
  }

  move({ poses, stampS, arrivedMs }: FramePoses): void {
    if (stampS !== this.stampS || this.before.length !== poses.length) {
      const continues = this.now.length === poses.length && stampS > this.stampS;
      this.before = continues ? this.now : poses;
      this.beforeStampS = continues ? this.stampS : stampS;
      this.beforeArrivedMs = this.arrivedMs;
    }
    this.now = poses;
    this.stampS = stampS;
    this.arrivedMs = arrivedMs;
  }

  /** Row of a moving frame; -1: there is none of that name. */
  row(name: string): number {
    return this.rows.get(name) ?? -1;
  }

  /** Names of all frames, moving ones and those that hang on them. */
  frameNames(): string[] {
    return [...this.names, ...[...this.fixed.keys()].filter((name) => !this.rows.has(name))];
  }

  /** Newest pose of any frame in the map; null where it is not known. */
  pose(name: string): Pose | null {
    return this.climb(name, 0);
  }

  /** The moving frame that `name` hangs on, and its pose there: for what moves along. */
  mount(name: string): { base: string; pose: Pose } | null {
    let pose: Pose = [0, 0, 0, 0, 0, 0, 1];
    let frame = name;
    for (let depth = 0; depth < DEEPEST; depth++) {
      if (this.rows.has(frame)) return { base: frame, pose };
      const edge = this.fixed.get(frame);
      if (edge === undefined) return null;
      pose = compose(edge.pose, pose);
      frame = edge.parent;
    }
    return null;
  }

  private climb(name: string, depth: number): Pose | null {
    if (name === "map") return [0, 0, 0, 0, 0, 0, 1];
    const row = this.rows.get(name);
    if (row !== undefined && this.now.length >= (row + 1) * POSE) {
      const at = row * POSE;
      const pose = Array.from(this.now.subarray(at, at + POSE)) as Pose;
      return Number.isNaN(pose[0]) ? null : pose;
    }
    const edge = this.fixed.get(name);
    if (edge === undefined || depth > DEEPEST) return null;
    const parent = this.climb(edge.parent, depth + 1);
    return parent === null ? null : compose(parent, edge.pose);
  }
}
