import { type InstancedBufferAttribute, Vector2, Vector3 } from "three";
import { POSE } from "../../link/protocol.ts";
import type { Air } from "../air/air.ts";
import { FADE } from "../air/fog.ts";
import { disposeParticles, particleMesh, type ParticleMesh } from "../air/particleMesh.ts";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import { fleet } from "./fleet.ts";

const PUFFS = 14;
const MAX_WRECKS = 32;
const RISE_S = 4;

/** Smoke over UAVs that have crashed. */
export class Smoke implements Part {
  readonly object: ParticleMesh;

  constructor(private readonly air: Air) {
    const count = PUFFS * MAX_WRECKS;
    this.object = particleMesh({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: {
        timeS: { value: 0 },
        wind: { value: new Vector2() },
        light: { value: new Vector3() },
      },
      attributes: {
        origin: { size: 3, values: new Float32Array(3 * count) },
        phase: {
          size: 1,
          values: Float32Array.from({ length: count }, (_, i) => (i % PUFFS) / PUFFS),
        },
      },
      renderOrder: 1450,
    });
  }

  update({ nowMs }: Moment): void {
    const origin = this.object.geometry.getAttribute("origin") as InstancedBufferAttribute;
    let wrecks = 0;
    for (const { crashed, row } of fleet.uavs) {
      const at = row * POSE;
      if (!crashed || at < 0 || wrecks >= MAX_WRECKS) continue;
      const [x, y, z] = [shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]!];
      for (let k = wrecks * PUFFS; k < (wrecks + 1) * PUFFS; k++) origin.setXYZ(k, x, y, z);
      wrecks++;
    }
    this.object.visible = wrecks > 0;
    if (wrecks === 0) return;
    this.object.geometry.instanceCount = wrecks * PUFFS;
    origin.needsUpdate = true;
    const { timeS, wind, light } = this.object.material.uniforms;
    timeS!.value = (nowMs / 1000) % 3600;
    wind!.value.set(this.air.weather.wind[0], this.air.weather.wind[1]);
    light!.value.set(...this.air.light.above).multiplyScalar(0.14);
  }

  dispose(): void {
    disposeParticles(this.object);
  }
}

const VERTEX = /* glsl */ `
#include <fog_pars_vertex>
attribute vec3 origin;
attribute float phase;
uniform float timeS;
uniform vec2 wind;
varying vec2 vOn;
varying float vAge;
void main() {
  float age = fract(timeS / ${RISE_S.toFixed(1)} + phase);
  float wobble = 12.0 * phase + timeS;
  vec3 p = origin + vec3(wind * age * 1.2, 1.9 * age) + 0.12 * vec3(sin(wobble), cos(1.3 * wobble), 0.0) * age;
  vec4 mvPosition = viewMatrix * vec4(p, 1.0);
  mvPosition.xy += position.xy * (0.1 + 0.45 * age);
  vOn = position.xy;
  vAge = age;
  gl_Position = projectionMatrix * mvPosition;
  #include <fog_vertex>
}
`;

const FRAGMENT = /* glsl */ `
#include <fog_pars_fragment>
uniform vec3 light;
varying vec2 vOn;
varying float vAge;
void main() {
  float soft = 1.0 - smoothstep(0.2, 1.0, length(vOn));
  gl_FragColor = vec4(light * (0.4 + vAge), soft * 0.55 * (1.0 - vAge));
  ${FADE}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;
