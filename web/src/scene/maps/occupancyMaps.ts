import {
  DataTexture,
  Mesh,
  MeshBasicMaterial,
  NearestFilter,
  PlaneGeometry,
  SRGBColorSpace,
} from "three";
import { compose, type Pose } from "../../lib/pose.ts";
import type { nav_msgs_OccupancyGrid } from "../../messages/generated.ts";
import { frameOf } from "../stage/frames.ts";
import type { Part } from "../stage/part.ts";
import { currentWorld } from "../world/currentWorld.ts";
import { pixelsOfGrid } from "./occupancy.ts";
import { TopicMeshes } from "./TopicMeshes.ts";

/** Maps lie so far above the ground, each a little above the one before, m. */
const LIFT_M = 0.06;
const STEP_M = 0.01;

type MapMesh = Mesh<PlaneGeometry, MeshBasicMaterial>;

/** Occupancy grids as images that lie on the ground. */
export function occupancyMaps(): Part {
  return new TopicMeshes<MapMesh>({
    layer: "maps",
    types: ["nav_msgs/msg/OccupancyGrid"],
    throttleMs: 500,
    build: (message, _type, others) => mapMesh(message as nav_msgs_OccupancyGrid, others),
    dispose: ({ material, geometry }) => {
      material.map?.dispose();
      material.dispose();
      geometry.dispose();
    },
  });
}

function mapMesh({ header, info, data }: nav_msgs_OccupancyGrid, below: number): MapMesh | null {
  const pixels = pixelsOfGrid(data, info.width, info.height);
  if (pixels === null || !(info.resolution > 0)) return null;
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
  const lift = LIFT_M + STEP_M * below;
  const ground = currentWorld.ground.heightAt(x + 0.5 * wide, y + 0.5 * high);
  mesh.position.set(x, y, Math.max(z, ground) + lift);
  mesh.quaternion.fromArray(turn);
  mesh.renderOrder = 1200;
  return mesh;
}
