import {
  AdditiveBlending,
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  Points,
  ShaderMaterial,
} from "three";
import { POSE } from "../../link/protocol.ts";
import type { Air } from "../air/air.ts";
import { rotated, rotationOf } from "../stage/poses.ts";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import { shapeOf } from "./airframeGeometry.ts";
import { fleet } from "./fleet.ts";

/** Red on the left, green on the right, white behind: as on every aircraft (ICAO Annex 6). */
const COLOURS = [
  [1, 0.06, 0.04],
  [0.05, 1, 0.15],
  [1, 1, 0.95],
] as const;
const MAX_UAVS = 1024;
const rotation = new Float64Array(9);
const offset = new Float64Array(3);

/** Position lights of all UAVs; at night they are what one sees of them. */
export class Lamps implements Part {
  readonly object: Points<BufferGeometry, ShaderMaterial>;
  private readonly lamp = new Float64Array(3);

  constructor(private readonly air: Air) {
    const geometry = new BufferGeometry();
    const count = MAX_UAVS * COLOURS.length;
    const positions = new BufferAttribute(new Float32Array(3 * count), 3).setUsage(
      DynamicDrawUsage,
    );
    const colours = Float32Array.from(
      { length: 3 * count },
      (_, i) => COLOURS[Math.floor(i / 3) % 3]![i % 3]!,
    );
    geometry.setAttribute("position", positions);
    geometry.setAttribute("tint", new BufferAttribute(colours, 3));
    const material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: { strength: { value: 0 }, scale: { value: 1 }, extinction: { value: 0 } },
      transparent: true,
      depthWrite: false,
      blending: AdditiveBlending,
    });
    this.object = new Points(geometry, material);
    this.object.frustumCulled = false;
    this.object.renderOrder = 1600;
  }

  update({ height, camera, renderer }: Moment): void {
    const strength = 0.12 + 0.88 * this.air.light.night;
    const positions = this.object.geometry.getAttribute("position") as BufferAttribute;
    let count = 0;
    for (const { row, airframe, crashed } of fleet.uavs) {
      const at = row * POSE;
      if (
        at < 0 ||
        crashed ||
        count >= COLOURS.length * MAX_UAVS ||
        !Number.isFinite(shown.poses[at])
      )
        continue;
      rotationOf(shown.poses, at, rotation);
      const distance =
        0.75 * Math.hypot(shapeOf(airframe).rotors[0]![0]!, shapeOf(airframe).rotors[0]![1]!);
      for (let k = 0; k < 3; k++) {
        this.lamp.set(
          k === 2
            ? [-distance, 0, 0]
            : [0.7 * distance, k === 0 ? 0.7 * distance : -0.7 * distance, 0],
        );
        rotated(rotation, this.lamp, 0, offset);
        const [x, y, z] = [shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]!];
        positions.setXYZ(count++, x + offset[0]!, y + offset[1]!, z + offset[2]!);
      }
    }
    this.object.geometry.setDrawRange(0, count);
    this.object.visible = count > 0;
    positions.needsUpdate = true;
    const { uniforms } = this.object.material;
    uniforms.strength!.value = strength;
    uniforms.extinction!.value = this.air.light.extinction;
    const pixels = height * renderer.getPixelRatio();
    uniforms.scale!.value = pixels / (2 * Math.tan((camera.fov * Math.PI) / 360));
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}

const VERTEX = /* glsl */ `
attribute vec3 tint;
uniform float strength, scale, extinction;
varying vec3 vTint;
void main() {
  vec4 mvPosition = viewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * mvPosition;
  float away = length(mvPosition.xyz);
  gl_PointSize = clamp(0.16 * strength * scale / away, 2.0 + 2.0 * strength, 40.0);
  vTint = tint * strength * exp(-extinction * away);
}
`;

const FRAGMENT = /* glsl */ `
varying vec3 vTint;
void main() {
  float far = length(gl_PointCoord - 0.5) * 2.0;
  float glow = pow(max(0.0, 1.0 - far), 2.0) + 1.0 - smoothstep(0.1, 0.3, far);
  gl_FragColor = vec4(vTint * glow, 1.0);
}
`;
