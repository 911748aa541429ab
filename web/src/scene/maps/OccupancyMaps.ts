import {
  DataTexture,
  Group,
  Mesh,
  MeshBasicMaterial,
  NearestFilter,
  PlaneGeometry,
  SRGBColorSpace,
} from "three";
import { link } from "../../link/link.ts";
import { compose, type Pose } from "../../lib/pose.ts";
import type { nav_msgs_OccupancyGrid } from "../../messages/generated.ts";
import { useView } from "../../state/view.ts";
import { frameOf } from "../stage/frames.ts";
import type { Moment, Part } from "../stage/part.ts";
import { followTopics, type Follower } from "../stage/topics.ts";
import { standing } from "../world/standing.ts";
import { picturesOfGrid } from "./occupancy.ts";

const GRID = "nav_msgs/msg/OccupancyGrid";
const THROTTLE_MS = 500;
/** Maps lie so far above the ground, each a little above the one before, m. */
const LIFT_M = 0.06;
const STEP_M = 0.01;

/** Occupancy grids as pictures that lie on the ground. */
export class OccupancyMaps implements Part {
  readonly object = new Group();
  private readonly follower: Follower;
  private readonly meshes = new Map<string, Mesh<PlaneGeometry, MeshBasicMaterial>>();

  constructor() {
    this.follower = followTopics(
      [GRID],
      (topic, type) =>
        link.subscribe(
          topic,
          type,
          ({ message }) => this.take(topic, message as nav_msgs_OccupancyGrid),
          {
            throttleMs: THROTTLE_MS,
          },
        ),
      (topic) => this.forget(topic),
    );
  }

  update(_moment: Moment): void {
    const { maps } = useView.getState().show;
    this.follower.enable(maps);
    this.object.visible = maps;
  }

  dispose(): void {
    this.follower.end();
    for (const topic of this.meshes.keys()) this.forget(topic);
  }

  private take(topic: string, { header, info, data }: nav_msgs_OccupancyGrid): void {
    this.forget(topic);
    const pixels = picturesOfGrid(data, info.width, info.height);
    if (pixels === null || !(info.resolution > 0)) return;
    const texture = new DataTexture(pixels, info.width, info.height);
    texture.colorSpace = SRGBColorSpace;
    texture.magFilter = NearestFilter;
    texture.needsUpdate = true;
    const [wide, high] = [info.width * info.resolution, info.height * info.resolution];
    const plane = new PlaneGeometry(wide, high).translate(0.5 * wide, 0.5 * high, 0);
    const material = new MeshBasicMaterial({
      map: texture,
      transparent: true,
      depthWrite: false,
      side: 2,
      toneMapped: false,
    });
    const mesh = new Mesh(plane, material);
    const { position: p, orientation: q } = info.origin;
    const origin: Pose = [p.x, p.y, p.z, q.x, q.y, q.z, q.w];
    const [x, y, z, ...turn] = compose(frameOf(header.frame_id) as Pose, origin);
    const lift = LIFT_M + STEP_M * this.meshes.size;
    mesh.position.set(
      x,
      y,
      Math.max(z, standing.ground.heightAt(x + 0.5 * wide, y + 0.5 * high)) + lift,
    );
    mesh.quaternion.fromArray(turn);
    mesh.renderOrder = 1200;
    this.meshes.set(topic, mesh);
    this.object.add(mesh);
  }

  private forget(topic: string): void {
    const mesh = this.meshes.get(topic);
    if (mesh === undefined) return;
    this.object.remove(mesh);
    this.meshes.delete(topic);
    mesh.material.map?.dispose();
    mesh.material.dispose();
    mesh.geometry.dispose();
  }
}
