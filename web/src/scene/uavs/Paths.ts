import { Group } from "three";
import { nowMs, secondsOf } from "../../lib/time.ts";
import { link } from "../../link/link.ts";
import type {
  geometry_msgs_PoseStamped,
  nav_msgs_Path,
  trajectory_msgs_MultiDOFJointTrajectory,
} from "../../messages/generated.ts";
import { useEpoch } from "../../state/epoch.ts";
import { useRestart } from "../../state/restarts.ts";
import { useView } from "../../state/view.ts";
import { SegmentLines } from "../lines/SegmentLines.ts";
import { inMap } from "../stage/frames.ts";
import { NearUavs } from "../stage/nearUavs.ts";
import type { Moment, Part } from "../stage/part.ts";
import { followTopics, type Follower } from "../stage/topics.ts";
import { colourOf } from "./colours.ts";
import { fleet } from "./fleet.ts";

const SEGMENTS = 12_000;
const WIDTH_PX = 3;
const GOAL_PX = 4;
/** Arms of the cross at a goal, m. */
const GOAL_M = 0.4;
const THROTTLE_MS = 200;
/** Of the selected UAV and so many nearest to it. */
const NEAREST = 100;

interface Shown {
  points: Float64Array;
  goal: boolean;
  untilMs: number;
}

/** What UAVs near the selected one mean to do: paths, trajectories and goals, in one draw call. */
export class Paths implements Part {
  readonly object = new Group();
  private readonly lines = new SegmentLines(SEGMENTS);
  private readonly paths = new Map<string, Shown>();
  private readonly near = new NearUavs(NEAREST);
  private changed = false;
  private readonly follower: Follower;
  private readonly ends: readonly (() => void)[];

  constructor() {
    this.object.add(this.lines.object);
    this.follower = followTopics(
      [
        "nav_msgs/msg/Path",
        "trajectory_msgs/msg/MultiDOFJointTrajectory",
        "geometry_msgs/msg/PoseStamped",
      ],
      (topic, type) => {
        if (type === "geometry_msgs/msg/PoseStamped" && !/goal/.test(topic)) return null;
        if (!this.near.includes(topic)) return null;
        return link.subscribe(topic, type, ({ message }) => this.take(topic, type, message), {
          throttleMs: THROTTLE_MS,
        });
      },
      (topic) => {
        this.paths.delete(topic);
        this.changed = true;
      },
    );
    this.ends = [
      useEpoch.subscribe(() => this.forget("/")),
      useRestart.subscribe(({ uav }) => this.forget(`/${uav}/`)),
    ];
  }

  update(moment: Moment): void {
    const { paths } = useView.getState().show;
    this.follower.enable(paths);
    this.object.visible = paths;
    if (paths && this.near.update(moment.nowMs)) {
      this.follower.choose((topic) => this.near.includes(topic));
      this.follower.look();
    }
    for (const [topic, { untilMs }] of this.paths)
      if (moment.nowMs > untilMs) {
        this.paths.delete(topic);
        this.changed = true;
      }
    if (this.changed) this.redraw();
    this.lines.update(moment);
  }

  dispose(): void {
    for (const end of this.ends) end();
    this.follower.end();
    this.lines.dispose();
  }

  /** Drop the goals and trajectories of topics below `prefix`: they were of another flight. */
  private forget(prefix: string): void {
    for (const [topic, { untilMs }] of this.paths)
      if (Number.isFinite(untilMs) && topic.startsWith(prefix)) this.paths.delete(topic);
    this.changed = true;
  }

  private take(topic: string, type: string, message: unknown): void {
    this.paths.set(topic, { ...read(type, message), goal: type.endsWith("PoseStamped") });
    this.changed = true;
  }

  private redraw(): void {
    this.changed = false;
    let count = 0;
    for (const [topic, { points, goal }] of this.paths) {
      const colour = this.colour(topic);
      const put = (a: number[], b: number[], width: number) => {
        if (count >= SEGMENTS) return;
        this.lines.put(count++, a[0]!, a[1]!, a[2]!, b[0]!, b[1]!, b[2]!, width, colour, 0.9);
      };
      if (goal) cross(points, (a, b) => put(a, b, GOAL_PX));
      for (let i = 3; i < points.length; i += 3)
        put([...points.subarray(i - 3, i)], [...points.subarray(i, i + 3)], WIDTH_PX);
    }
    this.lines.count = count;
    this.lines.send(0, count);
  }

  private colour(topic: string): [number, number, number] {
    const name = topic.split("/")[1] ?? "";
    return fleet.named(name)?.colour ?? colourOf(name.length + topic.length);
  }
}

/** Points in the map, and until when they mean something. */
function read(type: string, message: unknown): { points: Float64Array; untilMs: number } {
  const FOREVER = Infinity;
  if (type === "nav_msgs/msg/Path") {
    const { header, poses } = message as nav_msgs_Path;
    const positions = poses.map(({ pose }) => pose.position);
    return { points: inMap(header.frame_id, positions), untilMs: FOREVER };
  }
  if (type === "geometry_msgs/msg/PoseStamped") {
    const { header, pose } = message as geometry_msgs_PoseStamped;
    return { points: inMap(header.frame_id, [pose.position]), untilMs: nowMs() + 30_000 };
  }
  const { header, points } = message as trajectory_msgs_MultiDOFJointTrajectory;
  const positions = points.flatMap(({ transforms }) =>
    transforms.slice(0, 1).map((t) => t.translation),
  );
  const last = points.at(-1);
  const seconds = last === undefined ? 0 : secondsOf(last.time_from_start);
  return { points: inMap(header.frame_id, positions), untilMs: nowMs() + 1000 * (seconds + 5) };
}

/** Three strokes through a goal. */
function cross(points: Float64Array, stroke: (a: number[], b: number[]) => void): void {
  const [x, y, z] = points as unknown as [number, number, number];
  if (!Number.isFinite(x)) return;
  stroke([x - GOAL_M, y, z], [x + GOAL_M, y, z]);
  stroke([x, y - GOAL_M, z], [x, y + GOAL_M, z]);
  stroke([x, y, z - GOAL_M], [x, y, z + GOAL_M]);
}
