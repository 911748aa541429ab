import { POSE } from "../../link/protocol.ts";
import { useVehicles } from "../../state/vehicles.ts";
import { fleet } from "../uavs/fleet.ts";
import { shown } from "./shown.ts";

const LOOK_MS = 500;

/** The selected UAV and those nearest to it: of a large fleet, topics of all would be too many. */
export class NearUavs {
  private names = new Set<string>();
  private lookedMs = -Infinity;
  private selected = "";

  /** `count`: how many beside the selected one. */
  constructor(private readonly count: number) {}

  /** Look again now and then; whether others are near. */
  update(nowMs: number): boolean {
    const { selected } = useVehicles.getState();
    if (nowMs - this.lookedMs < LOOK_MS && selected === this.selected) return false;
    this.lookedMs = nowMs;
    this.selected = selected;
    const next = this.nearest();
    const alike = next.size === this.names.size && [...next].every((name) => this.names.has(name));
    this.names = next;
    return !alike;
  }

  /** Whether a topic is that of a UAV which is near, or of none. */
  includes(topic: string): boolean {
    const uav = topic.split("/")[1] ?? "";
    return this.names.has(uav) || fleet.named(uav) === undefined;
  }

  private nearest(): Set<string> {
    const middle = fleet.named(this.selected) ?? fleet.uavs[0];
    if (middle === undefined || middle.row < 0) return new Set();
    const { poses } = shown;
    const b = middle.row * POSE;
    const square = (row: number) => {
      const a = row * POSE;
      const [dx, dy] = [poses[a]! - poses[b]!, poses[a + 1]! - poses[b + 1]!];
      const away = dx * dx + dy * dy + (poses[a + 2]! - poses[b + 2]!) ** 2;
      return row < 0 || Number.isNaN(away) ? Infinity : away;
    };
    const away = fleet.uavs.map(({ name, row }) => ({ name, away: square(row) }));
    away.sort((one, other) => (one.away < other.away ? -1 : Number(one.away > other.away)));
    return new Set(away.slice(0, this.count + 1).map(({ name }) => name));
  }
}
