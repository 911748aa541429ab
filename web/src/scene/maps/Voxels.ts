import {
  BoxGeometry,
  Color,
  Group,
  InstancedMesh,
  MeshLambertMaterial,
  SRGBColorSpace,
} from "three";
import { turbo } from "../../lib/colourMaps.ts";
import { link } from "../../link/link.ts";
import type {
  octomap_msgs_Octomap,
  octomap_msgs_OctomapWithPose,
} from "../../messages/generated.ts";
import { useView } from "../../state/view.ts";
import { frameOf } from "../stage/frames.ts";
import { toMap } from "../stage/placing.ts";
import type { Moment, Part } from "../stage/part.ts";
import { putMatrix, rotationOf } from "../stage/poses.ts";
import { followTopics, type Follower } from "../stage/topics.ts";
import { occupiedCubes, type Voxels as Cubes } from "./octomap.ts";

const PLAIN = "octomap_msgs/msg/Octomap";
const POSED = "octomap_msgs/msg/OctomapWithPose";
const THROTTLE_MS = 1000;
const MOST = 150_000;

/** Occupied voxels of OctoMaps, coloured by their height; one draw call a map. */
export class Voxels implements Part {
  readonly object = new Group();
  private readonly meshes = new Map<string, InstancedMesh>();
  private readonly follower: Follower;

  constructor() {
    this.follower = followTopics(
      [PLAIN, POSED],
      (topic, type) =>
        link.subscribe(
          topic,
          type,
          ({ message }) =>
            this.take(
              topic,
              type === POSED
                ? (message as octomap_msgs_OctomapWithPose).octomap
                : (message as octomap_msgs_Octomap),
            ),
          { throttleMs: THROTTLE_MS },
        ),
      (topic) => this.forget(topic),
    );
  }

  update(_moment: Moment): void {
    const { voxels } = useView.getState().show;
    this.follower.enable(voxels);
    this.object.visible = voxels;
  }

  dispose(): void {
    this.follower.end();
    for (const topic of this.meshes.keys()) this.forget(topic);
  }

  private take(topic: string, map: octomap_msgs_Octomap): void {
    this.forget(topic);
    const data = Uint8Array.from(map.data, (byte) => byte & 0xff);
    const coloured = map.id === "ColorOcTree";
    const cubes = occupiedCubes(data, map.resolution, map.binary, MOST, coloured);
    if (cubes.count === 0) return;
    const mesh = meshOf(cubes, frameOf(map.header.frame_id));
    this.meshes.set(topic, mesh);
    this.object.add(mesh);
  }

  private forget(topic: string): void {
    const mesh = this.meshes.get(topic);
    if (mesh === undefined) return;
    this.object.remove(mesh);
    this.meshes.delete(topic);
    mesh.geometry.dispose();
    (mesh.material as MeshLambertMaterial).dispose();
    mesh.dispose();
  }
}

function meshOf({ cubes, count }: Cubes, pose: ReturnType<typeof frameOf>): InstancedMesh {
  const mesh = new InstancedMesh(new BoxGeometry(2, 2, 2), new MeshLambertMaterial(), count);
  const rotation = new Float64Array(9);
  rotationOf(pose, 0, rotation);
  let [low, high] = [Infinity, -Infinity];
  for (let i = 2; i < 4 * count; i += 4) {
    low = Math.min(low, cubes[i]!);
    high = Math.max(high, cubes[i]!);
  }
  const colour = new Color();
  for (let i = 0; i < count; i++) {
    const [x, y, z, half] = cubes.subarray(4 * i, 4 * i + 4) as unknown as [
      number,
      number,
      number,
      number,
    ];
    putMatrix(mesh.instanceMatrix.array, i, rotation, 0.97 * half, ...toMap(pose, x, y, z));
    const [r, g, b] = turbo(high > low ? 0.1 + (0.8 * (z - low)) / (high - low) : 0.5);
    mesh.setColorAt(i, colour.setRGB(r / 255, g / 255, b / 255, SRGBColorSpace));
  }
  mesh.frustumCulled = false;
  return mesh;
}
