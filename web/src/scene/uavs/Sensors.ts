import { DynamicDrawUsage, Group, InstancedMesh, MeshStandardMaterial } from "three";
import { link } from "../../link/link.ts";
import { POSE } from "../../link/protocol.ts";
import type { Part } from "../stage/part.ts";
import { rotated, product, putMatrix, rotationOf } from "../stage/poses.ts";
import { shown } from "../stage/shown.ts";
import { cameraBody, lidarBody } from "./airframeGeometry.ts";
import { fleet } from "./fleet.ts";

/** Frames that have a body: by their names; optical frames being the same camera again. */
const LIDAR = /(?:laser|lidar|velodyne|scanner|ouster)/i;
const CAMERA = /(?:camera|cam_|_cam|front|down)/i;
const NO_BODY = /optical|base_link|odom|imu|gnss|gps|sonar|range|baro|magnet/i;

interface Mount {
  row: number;
  pose: Float64Array;
}

/** Scanners and cameras on the UAVs, where their frames are: one draw call for each sort. */
export class Sensors implements Part {
  readonly object = new Group();
  private readonly material = new MeshStandardMaterial({ vertexColors: true, roughness: 0.45 });
  private sorts: { mesh: InstancedMesh; mounts: Mount[] }[] = [];
  private framesVersion = -1;
  private fleetVersion = -1;

  update(): void {
    const { version } = link.frames;
    if (version !== this.framesVersion || fleet.version !== this.fleetVersion) {
      this.framesVersion = version;
      this.fleetVersion = fleet.version;
      this.rebuild();
    }
    for (const { mesh, mounts } of this.sorts) {
      mounts.forEach((mount, i) => place(mesh, i, mount));
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  dispose(): void {
    for (const { mesh } of this.sorts) {
      mesh.geometry.dispose();
      mesh.dispose();
    }
    this.object.clear();
    this.sorts = [];
  }

  private rebuild(): void {
    this.dispose();
    const uavs = new Set(fleet.uavs.map(({ name }) => name));
    const lidars: Mount[] = [];
    const cameras: Mount[] = [];
    for (const frame of link.frames.frameNames()) {
      const [uav, ...rest] = frame.split("/");
      const name = rest.join("/");
      if (!uavs.has(uav!) || name === "" || NO_BODY.test(name)) continue;
      const sort = LIDAR.test(name) ? lidars : CAMERA.test(name) ? cameras : null;
      const mount = sort === null ? null : mountOf(frame);
      if (mount !== null) sort!.push(mount);
    }
    this.add(lidars, "lidar");
    this.add(cameras, "camera");
  }

  private add(mounts: Mount[], sort: "lidar" | "camera"): void {
    if (mounts.length === 0) return;
    const geometry = sort === "lidar" ? lidarBody() : cameraBody();
    const mesh = new InstancedMesh(geometry, this.material, mounts.length);
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    mesh.castShadow = true;
    mesh.frustumCulled = false;
    this.object.add(mesh);
    this.sorts.push({ mesh, mounts });
  }
}

function mountOf(frame: string): Mount | null {
  const mount = link.frames.mount(frame);
  if (mount === null) return null;
  return { row: link.frames.row(mount.base), pose: Float64Array.from(mount.pose) };
}

const base = new Float64Array(9);
const own = new Float64Array(9);
const both = new Float64Array(9);
const offset = new Float64Array(3);

function place(mesh: InstancedMesh, i: number, { row, pose }: Mount): void {
  const at = row * POSE;
  const { poses } = shown;
  if (at < 0 || !Number.isFinite(poses[at]! + poses[at + 6]!)) {
    putMatrix(mesh.instanceMatrix.array, i, base, 0, 0, 0, 0);
    return;
  }
  rotationOf(poses, at, base);
  rotationOf(pose, 0, own);
  product(base, own, both);
  rotated(base, pose, 0, offset);
  putMatrix(
    mesh.instanceMatrix.array,
    i,
    both,
    1,
    poses[at]! + offset[0]!,
    poses[at + 1]! + offset[1]!,
    poses[at + 2]! + offset[2]!,
  );
}
