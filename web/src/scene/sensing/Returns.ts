import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  Points,
  ShaderMaterial,
  UniformsLib,
  UniformsUtils,
} from "three";
import { PLAYING } from "../../link/commands.ts";
import { link } from "../../link/link.ts";
import type { sensor_msgs_LaserScan, sensor_msgs_PointCloud2 } from "../../messages/generated.ts";
import { simulatedS, useSimulation } from "../../state/simulation.ts";
import { useView } from "../../state/view.ts";
import { FADE } from "../air/fog.ts";
import { frameOf } from "../stage/frames.ts";
import { toMap } from "../stage/mapFrame.ts";
import { NearUavs } from "../stage/nearUavs.ts";
import type { Moment, Part } from "../stage/part.ts";
import { LEVELS } from "../stage/quality.ts";
import { followTopics, isKnown, type Follower } from "../stage/topics.ts";
import { currentWorld } from "../world/currentWorld.ts";
import {
  colouringOf,
  heightColour,
  LEVEL,
  NODDING,
  type Bytes,
  type ReturnColouring,
} from "./returnColours.ts";
import { pointsOfCloud, pointsOfScan } from "./pointClouds.ts";

const SCAN = "sensor_msgs/msg/LaserScan";
const CLOUD = "sensor_msgs/msg/PointCloud2";
const THROTTLE_MS = 50;
const FADE_S = 1;
const MAX_PER_SWEEP = 4000;
/** Sensors of the selected UAV and of so many UAVs nearest to it. */
const NEAREST = 3;
const FIXED: Record<ReturnColouring, Bytes | null> = {
  level: LEVEL,
  nodding: NODDING,
  height: null,
};

/** Returns of LIDARs: one buffer that runs round, one draw call; each return fades within a second. */
export class Returns implements Part {
  readonly object: Points<BufferGeometry, ShaderMaterial>;
  private readonly follower: Follower;
  private readonly near = new NearUavs(NEAREST);
  private nowS = 0;
  private simulatedS = 0;
  private played = false;
  private next = 0;
  private capacity = LEVELS[0]!.returns;
  private readonly room: number;

  constructor() {
    this.room = LEVELS.at(-1)!.returns;
    const geometry = new BufferGeometry();
    const attribute = (size: number, array: Float32Array | Uint8Array, normalized = false) =>
      new BufferAttribute(array, size, normalized).setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", attribute(3, new Float32Array(3 * this.room)));
    geometry.setAttribute("born", attribute(1, new Float32Array(this.room).fill(-1e6)));
    geometry.setAttribute("tint", attribute(3, new Uint8Array(3 * this.room), true));
    geometry.setDrawRange(0, 0);
    this.object = new Points(geometry, materialOf());
    this.object.frustumCulled = false;
    this.object.renderOrder = 1300;
    this.follower = followTopics(
      [SCAN, CLOUD],
      (topic, type) => this.begin(topic, type),
      () => undefined,
    );
  }

  update({ nowMs, stepS, quality, height, camera, renderer }: Moment): void {
    this.nowS += this.passed(stepS);
    this.capacity = quality.returns;
    const { lidar } = useView.getState().show;
    this.object.visible = lidar;
    this.follower.enable(lidar);
    if (lidar && this.near.update(nowMs)) {
      this.follower.choose((topic) => this.near.includes(topic));
      this.follower.look();
    }
    const { nowS, size } = this.object.material.uniforms;
    nowS!.value = this.nowS;
    size!.value = (height * renderer.getPixelRatio()) / Math.tan((camera.fov * Math.PI) / 360);
  }

  /** How much older returns have become, s: in a paused simulation only by what it is stepped. */
  private passed(stepS: number): number {
    const simulated = simulatedS();
    const stepped = Math.max(0, simulated - this.simulatedS);
    this.simulatedS = simulated;
    const { status } = useSimulation.getState();
    const played = this.played;
    this.played = status === null || status.state === PLAYING;
    // Bounded while it plays, the frame in which it is paused included: where frames are slow, returns
    // are still seen in some.
    if (this.played) return stepS;
    return played ? Math.min(stepped, stepS) : stepped;
  }

  dispose(): void {
    this.follower.end();
    this.object.geometry.dispose();
    this.object.material.dispose();
  }

  private begin(topic: string, type: string): (() => void) | null {
    if (!this.near.includes(topic)) return null;
    // Where a simulation publishes the returns themselves they are corrected already, nodding included.
    if (type === SCAN && isKnown(topic.replace(/scan$/, "points"))) return null;
    const take = ({ message }: { message: unknown }) => this.take(topic, type, message);
    return link.subscribe(topic, type, take, { throttleMs: THROTTLE_MS });
  }

  private take(topic: string, type: string, message: unknown): void {
    const maxPoints = Math.min(MAX_PER_SWEEP, this.capacity / 4);
    const { header } = message as sensor_msgs_LaserScan;
    const points =
      type === SCAN
        ? pointsOfScan(message as sensor_msgs_LaserScan, maxPoints)
        : pointsOfCloud(message as sensor_msgs_PointCloud2, maxPoints);
    this.add(topic, frameOf(header.frame_id), points);
  }

  private add(topic: string, pose: ReturnType<typeof frameOf>, points: Float32Array): void {
    const { position, born, tint } = this.object.geometry.attributes as Record<
      string,
      BufferAttribute
    >;
    const fixed = FIXED[colouringOf(topic)];
    const ground = currentWorld.ground.heightAt(pose[0], pose[1]);
    const from = this.next;
    for (let i = 0; i + 2 < points.length; i += 3) {
      const [x, y, z] = toMap(pose, points[i]!, points[i + 1]!, points[i + 2]!);
      const at = this.next;
      position!.setXYZ(at, x, y, z);
      born!.setX(at, this.nowS);
      const [r, g, b] = fixed ?? heightColour(z - ground);
      tint!.array[3 * at] = r;
      tint!.array[3 * at + 1] = g;
      tint!.array[3 * at + 2] = b;
      this.next = (this.next + 1) % Math.min(this.room, this.capacity);
    }
    this.send(from, this.next);
  }

  /** Have what was written drawn; at the end of the ring in two pieces. */
  private send(from: number, to: number): void {
    const { attributes, drawRange } = this.object.geometry;
    const ranges =
      to >= from
        ? [[from, to]]
        : [
            [from, this.capacity],
            [0, to],
          ];
    for (const attribute of Object.values(attributes) as BufferAttribute[]) {
      for (const [a, b] of ranges)
        if (b! > a!)
          attribute.addUpdateRange(a! * attribute.itemSize, (b! - a!) * attribute.itemSize);
      attribute.needsUpdate = true;
    }
    const used = to >= from ? to : this.capacity;
    this.object.geometry.setDrawRange(0, Math.max(drawRange.count, used));
  }
}

function materialOf(): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: UniformsUtils.merge([UniformsLib.fog, { nowS: { value: 0 }, size: { value: 1 } }]),
    transparent: true,
    depthWrite: false,
    fog: true,
  });
}

const VERTEX = /* glsl */ `
#include <fog_pars_vertex>
attribute float born;
attribute vec3 tint;
uniform float nowS, size;
varying vec4 vTint;
void main() {
  float left = 1.0 - (nowS - born) / ${FADE_S.toFixed(1)};
  vec4 mvPosition = viewMatrix * vec4(position, 1.0);
  gl_Position = left > 0.0 ? projectionMatrix * mvPosition : vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = clamp(0.035 * size / max(0.1, -mvPosition.z), 2.0, 9.0);
  vTint = vec4(tint, sqrt(max(left, 0.0)));
  #include <fog_vertex>
}
`;

const FRAGMENT = /* glsl */ `
#include <fog_pars_fragment>
varying vec4 vTint;
void main() {
  if (length(gl_PointCoord - 0.5) > 0.5) discard;
  gl_FragColor = vTint;
  ${FADE}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;
