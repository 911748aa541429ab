import { Vector3, type PerspectiveCamera } from "three";
import { putAt } from "../link/commands.ts";
import { POSE } from "../link/protocol.ts";
import { pickUav } from "../scene/stage/picking.ts";
import { shown } from "../scene/stage/shown.ts";
import { fleet } from "../scene/uavs/fleet.ts";
import { tellFailure, reasonOf } from "../state/notices.ts";
import { useTool } from "../state/tool.ts";
import { useVehicles } from "../state/vehicles.ts";

/** The simulation is told of a dragged UAV so often, ms. */
const TELL_MS = 100;

interface Screen {
  width: number;
  height: number;
}

/** Drags the selected UAV over the level on which it is, while the tool for that is at hand. */
export class Mover {
  private uav = "";
  private level = 0;
  private turn = { x: 0, y: 0, z: 0, w: 1 };
  private toldMs = 0;
  private asked = false;
  private readonly way = new Vector3();

  /** Whether the press has taken hold of the selected UAV. */
  grab(x: number, y: number, camera: PerspectiveCamera, screen: Screen): boolean {
    const { selected } = useVehicles.getState();
    if (!useTool.getState().moving || pickUav(x, y, camera, screen) !== selected) return false;
    const at = (fleet.named(selected)?.row ?? -1) * POSE;
    if (selected === "" || at < 0) return false;
    const [, , z, qx, qy, qz, qw] = shown.poses.subarray(at, at + POSE);
    // It is put down level, heading where it did.
    const yaw = Math.atan2(2 * (qw! * qz! + qx! * qy!), 1 - 2 * (qy! * qy! + qz! * qz!));
    this.turn = { x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) };
    this.uav = selected;
    this.level = z!;
    return true;
  }

  dragTo(x: number, y: number, camera: PerspectiveCamera, { width, height }: Screen): void {
    const nowMs = performance.now();
    if (this.uav === "" || this.asked || nowMs - this.toldMs < TELL_MS) return;
    this.way.set((2 * x) / width - 1, 1 - (2 * y) / height, 0.5).unproject(camera);
    this.way.sub(camera.position);
    const times = (this.level - camera.position.z) / this.way.z;
    if (!(times > 0)) return; // above the horizon
    this.toldMs = nowMs;
    this.way.multiplyScalar(times).add(camera.position);
    this.asked = true;
    const place = { x: this.way.x, y: this.way.y, z: this.level };
    putAt(this.uav, place, this.turn)
      .catch((error: unknown) => {
        tellFailure(this.uav, reasonOf(error));
        this.drop();
      })
      .finally(() => {
        this.asked = false;
      });
  }

  drop(): void {
    this.uav = "";
  }
}
