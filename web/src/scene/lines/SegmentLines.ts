import {
  BufferAttribute,
  DynamicDrawUsage,
  InstancedBufferGeometry,
  InstancedInterleavedBuffer,
  InterleavedBufferAttribute,
  Mesh,
  ShaderMaterial,
  UniformsLib,
  UniformsUtils,
  Vector2,
} from "three";
import { FADE } from "../air/fog.ts";
import type { Moment } from "../stage/part.ts";

/** Numbers a segment: start x y z, width, end x y z, birth, r g b a. */
const STRIDE = 12;

export interface LineLook {
  /** Segments fade away in this time after their birth, s; 0: never. */
  fadeS?: number;
  /** Widths are CSS pixels, else metres. */
  pixels?: boolean;
  /** Shown through everything else. */
  above?: boolean;
}

/** Many straight segments of any width and colour in one draw call. */
export class SegmentLines {
  readonly object: Mesh<InstancedBufferGeometry, ShaderMaterial>;
  readonly capacity: number;
  private readonly buffer: InstancedInterleavedBuffer;

  constructor(capacity: number, { fadeS = 0, pixels = true, above = false }: LineLook = {}) {
    this.capacity = capacity;
    this.buffer = new InstancedInterleavedBuffer(new Float32Array(capacity * STRIDE), STRIDE);
    this.buffer.setUsage(DynamicDrawUsage);
    const geometry = new InstancedBufferGeometry();
    const corners = new Float32Array([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0]);
    geometry.setAttribute("position", new BufferAttribute(corners, 3));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    const slice = (size: number, at: number) =>
      new InterleavedBufferAttribute(this.buffer, size, at);
    geometry.setAttribute("start", slice(4, 0));
    geometry.setAttribute("end", slice(4, 4));
    geometry.setAttribute("tint", slice(4, 8));
    geometry.instanceCount = 0;
    const uniforms = UniformsUtils.merge([
      UniformsLib.fog,
      {
        size: { value: new Vector2(1, 1) },
        nowS: { value: 0 },
        fadeS: { value: fadeS },
        opacity: { value: 1 },
      },
    ]);
    const material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms,
      defines: pixels ? { PIXELS: "" } : {},
      transparent: true,
      depthWrite: false,
      depthTest: !above,
      fog: true,
    });
    this.object = new Mesh(geometry, material);
    this.object.frustumCulled = false;
    this.object.visible = false;
    this.object.renderOrder = above ? 3000 : 1500;
  }

  /** How many of the first segments are shown. */
  get count(): number {
    return this.object.geometry.instanceCount;
  }

  set count(count: number) {
    this.object.geometry.instanceCount = Math.min(count, this.capacity);
    this.object.visible = count > 0;
  }

  set opacity(opacity: number) {
    this.object.material.uniforms.opacity!.value = opacity;
  }

  /** Put segment `i`; born at `bornS` where lines fade. Upload with `send` afterwards. */
  put(
    i: number,
    ax: number,
    ay: number,
    az: number,
    bx: number,
    by: number,
    bz: number,
    width: number,
    colour: readonly number[],
    alpha: number,
    bornS = 0,
  ): void {
    const { array } = this.buffer;
    let at = i * STRIDE;
    array[at++] = ax;
    array[at++] = ay;
    array[at++] = az;
    array[at++] = width;
    array[at++] = bx;
    array[at++] = by;
    array[at++] = bz;
    array[at++] = bornS;
    array[at++] = colour[0]!;
    array[at++] = colour[1]!;
    array[at++] = colour[2]!;
    array[at] = alpha;
  }

  /** Have segments `from` up to `to` drawn as they were put. */
  send(from: number, to: number): void {
    if (to <= from) return;
    this.buffer.addUpdateRange(from * STRIDE, (to - from) * STRIDE);
    this.buffer.needsUpdate = true;
  }

  /** Draw segments `from` up to `to` no more. */
  blank(from: number, to: number): void {
    (this.buffer.array as Float32Array).fill(0, from * STRIDE, to * STRIDE);
    this.send(from, to);
  }

  /** Forget all segments. */
  clear(): void {
    (this.buffer.array as Float32Array).fill(0);
    this.buffer.clearUpdateRanges();
    this.buffer.needsUpdate = true;
    this.count = 0;
  }

  update({ width, height }: Moment, nowS = 0): void {
    const { size, nowS: now } = this.object.material.uniforms;
    size!.value.set(width, height);
    now!.value = nowS;
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}

const VERTEX = /* glsl */ `
#include <fog_pars_vertex>
attribute vec4 start, end, tint;
uniform vec2 size;
uniform float nowS, fadeS;
varying vec4 vTint;
varying float vAcross, vSoft;
void main() {
  vec4 a = viewMatrix * vec4(start.xyz, 1.0), b = viewMatrix * vec4(end.xyz, 1.0);
  // What lies behind the camera is cut off at the near plane.
  float near = -0.06;
  if (a.z > near && b.z < near) a = mix(b, a, (near - b.z) / (a.z - b.z));
  if (b.z > near && a.z < near) b = mix(a, b, (near - a.z) / (b.z - a.z));
  vec4 mvPosition = mix(a, b, position.x);
  vTint = tint;
  if (fadeS > 0.0) vTint.a *= clamp(1.0 - (nowS - end.w) / fadeS, 0.0, 1.0);
#ifdef PIXELS
  vec4 from = projectionMatrix * a, to = projectionMatrix * b;
  vec2 along = (to.xy / to.w - from.xy / from.w) * size;
  vec2 side = length(along) > 1e-4 ? normalize(vec2(-along.y, along.x)) : vec2(1.0, 0.0);
  gl_Position = projectionMatrix * mvPosition;
  gl_Position.xy += side * position.y * (start.w + 1.0) / size * gl_Position.w;
  vSoft = 1.0 / (start.w + 1.0);
#else
  vec3 side = cross(b.xyz - a.xyz, mvPosition.xyz);
  mvPosition.xyz += normalize(side + vec3(0.0, 1e-9, 0.0)) * position.y * 0.5 * start.w;
  gl_Position = projectionMatrix * mvPosition;
  vSoft = 0.1;
#endif
  vAcross = position.y;
  if (vTint.a <= 0.0 || (a.z > near && b.z > near)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  #include <fog_vertex>
}
`;

const FRAGMENT = /* glsl */ `
#include <fog_pars_fragment>
uniform float opacity;
varying vec4 vTint;
varying float vAcross, vSoft;
void main() {
  float edge = 1.0 - smoothstep(1.0 - 2.0 * vSoft, 1.0, abs(vAcross));
  gl_FragColor = vec4(vTint.rgb, vTint.a * edge * opacity);
  ${FADE}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;
