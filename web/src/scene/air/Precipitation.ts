import { Vector3 } from "three";
import type { Moment, Part } from "../stage/part.ts";
import type { Air } from "./air.ts";
import { FADE } from "./fog.ts";
import { disposeParticles, particleMesh, type ParticleMesh } from "./particleMesh.ts";

/** Drops and flakes fill a box of this side around the camera, m. */
const BOX_M = 24;
/** mm/h at which all drops or flakes are drawn. */
const HEAVY = { rain: 40, snow: 8 };
const FALL_M_S = { rain: 8, snow: 1.3 };
/** So long a drop streaks, s: what an exposure of a fiftieth of a second shows. */
const STREAK_S = 0.02;

const VERTEX = /* glsl */ `
#include <fog_pars_vertex>
attribute vec3 origin;
uniform vec3 eye, offset, streak;
uniform float thick, snowing;
varying vec2 vAcross;
void main() {
  // Each falls through its box for ever; the box goes with the camera.
  vec3 p = mod(origin * ${BOX_M.toFixed(1)} + offset - eye, ${BOX_M.toFixed(1)}) - ${(BOX_M / 2).toFixed(1)} + eye;
  vec4 mvPosition = viewMatrix * vec4(p, 1.0);
  vec3 along = (viewMatrix * vec4(streak, 0.0)).xyz;
  vec3 side = normalize(cross(along, mvPosition.xyz));
  vec3 ahead = snowing > 0.5 ? normalize(cross(mvPosition.xyz, side)) * thick : along * 0.5;
  mvPosition.xyz += side * position.x * thick + ahead * position.y;
  vAcross = position.xy;
  gl_Position = projectionMatrix * mvPosition;
  #include <fog_vertex>
}
`;

const FRAGMENT = /* glsl */ `
#include <fog_pars_fragment>
varying vec2 vAcross;
uniform vec3 light;
uniform float snowing;
void main() {
  float round = 1.0 - smoothstep(0.3, 1.0, length(vAcross));
  float alpha = snowing > 0.5 ? round * 0.9 : (1.0 - abs(vAcross.x)) * (1.0 - abs(vAcross.y)) * 0.4;
  gl_FragColor = vec4(light, alpha);
  ${FADE}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;

/** Rain or snow around the camera. */
export class Precipitation implements Part {
  readonly object: ParticleMesh;
  private readonly offset = new Vector3();

  constructor(
    private readonly kind: "rain" | "snow",
    private readonly air: Air,
    maxParticles: number,
  ) {
    const vector = () => ({ value: new Vector3() });
    this.object = particleMesh({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: {
        eye: vector(),
        offset: vector(),
        streak: vector(),
        light: vector(),
        thick: { value: kind === "rain" ? 0.006 : 0.022 },
        snowing: { value: kind === "snow" ? 1 : 0 },
      },
      attributes: {
        origin: { size: 3, values: Float32Array.from({ length: 3 * maxParticles }, Math.random) },
      },
      renderOrder: 2000,
    });
  }

  update({ camera, stepS, quality }: Moment): void {
    const { weather, light } = this.air;
    const share = Math.min(1, Math.sqrt(weather[this.kind] / HEAVY[this.kind]));
    const count = Math.round(share * quality.particles);
    this.object.visible = count > 0;
    if (count === 0) return;
    this.object.geometry.instanceCount = count;
    const fall = FALL_M_S[this.kind];
    const [wx, wy] = weather.wind;
    const { eye, offset, streak, light: shade } = this.object.material.uniforms;
    this.offset.x = (this.offset.x + wx * stepS) % BOX_M;
    this.offset.y = (this.offset.y + wy * stepS) % BOX_M;
    this.offset.z = (this.offset.z - fall * stepS) % BOX_M;
    eye!.value.copy(camera.position);
    offset!.value.copy(this.offset);
    streak!.value.set(wx * STREAK_S, wy * STREAK_S, -fall * STREAK_S).multiplyScalar(2);
    const bright = this.kind === "snow" ? 1 : 0.75;
    shade!.value
      .set(...light.above)
      .multiplyScalar(bright)
      .addScalar(0.01);
  }

  dispose(): void {
    disposeParticles(this.object);
  }
}
