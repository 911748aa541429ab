import { BoxGeometry, Color, InstancedMesh, MeshLambertMaterial, SRGBColorSpace } from "three";
import { turbo } from "../../lib/colourMaps.ts";
import type {
  octomap_msgs_Octomap,
  octomap_msgs_OctomapWithPose,
} from "../../messages/generated.ts";
import { frameOf } from "../stage/frames.ts";
import { toMap } from "../stage/mapFrame.ts";
import type { Part } from "../stage/part.ts";
import { putMatrix, rotationOf } from "../stage/poses.ts";
import { occupiedCubes, type Voxels as Cubes } from "./octomap.ts";
import { TopicMeshes } from "./TopicMeshes.ts";

const POSED = "octomap_msgs/msg/OctomapWithPose";
const MAX_CUBES = 150_000;

type VoxelMesh = InstancedMesh<BoxGeometry, MeshLambertMaterial>;

/** Occupied voxels of OctoMaps, coloured by their height; one draw call a map. */
export function voxels(): Part {
  return new TopicMeshes<VoxelMesh>({
    layer: "voxels",
    types: ["octomap_msgs/msg/Octomap", POSED],
    throttleMs: 1000,
    build: (message, type) =>
      voxelMesh(
        type === POSED
          ? (message as octomap_msgs_OctomapWithPose).octomap
          : (message as octomap_msgs_Octomap),
      ),
    dispose: (mesh) => {
      mesh.geometry.dispose();
      mesh.material.dispose();
      mesh.dispose();
    },
  });
}

function voxelMesh(map: octomap_msgs_Octomap): VoxelMesh | null {
  const data = Uint8Array.from(map.data, (byte) => byte & 0xff);
  const coloured = map.id === "ColorOcTree";
  const cubes = occupiedCubes(data, map.resolution, map.binary, MAX_CUBES, coloured);
  return cubes.count === 0 ? null : meshOf(cubes, frameOf(map.header.frame_id));
}

function meshOf({ cubes, count }: Cubes, pose: ReturnType<typeof frameOf>): VoxelMesh {
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
