import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  Points,
  ShaderMaterial,
  UniformsLib,
  UniformsUtils,
} from "three";
import { FADE } from "../air/fog.ts";

/** UAVs too far away for a shape: a dot of one size each, in one draw call. */
export class Dots {
  readonly object: Points<BufferGeometry, ShaderMaterial>;
  private readonly positions: BufferAttribute;
  private readonly tints: BufferAttribute;
  private count = 0;

  constructor(
    capacity: number,
    private readonly radiusPx: number,
  ) {
    const geometry = new BufferGeometry();
    const attribute = () =>
      new BufferAttribute(new Float32Array(3 * capacity), 3).setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", (this.positions = attribute()));
    geometry.setAttribute("tint", (this.tints = attribute()));
    const material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: UniformsUtils.merge([UniformsLib.fog, { size: { value: 1 } }]),
      fog: true,
    });
    this.object = new Points(geometry, material);
    this.object.frustumCulled = false;
  }

  begin(): void {
    this.count = 0;
  }

  put(x: number, y: number, z: number, [r, g, b]: readonly [number, number, number]): void {
    this.positions.setXYZ(this.count, x, y, z);
    this.tints.setXYZ(this.count++, r, g, b);
  }

  /** Show what was put since `begin`. */
  end(pixelRatio: number): void {
    this.object.visible = this.count > 0;
    this.object.geometry.setDrawRange(0, this.count);
    this.positions.needsUpdate = this.tints.needsUpdate = this.count > 0;
    this.object.material.uniforms.size!.value = 2 * this.radiusPx * pixelRatio;
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}

const VERTEX = /* glsl */ `
#include <fog_pars_vertex>
attribute vec3 tint;
uniform float size;
varying vec3 vTint;
void main() {
  vec4 mvPosition = viewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * mvPosition;
  gl_PointSize = max(2.0, size);
  vTint = tint;
  #include <fog_vertex>
}
`;

const FRAGMENT = /* glsl */ `
#include <fog_pars_fragment>
varying vec3 vTint;
void main() {
  if (length(gl_PointCoord - 0.5) > 0.5) discard;
  gl_FragColor = vec4(vTint, 1.0);
  ${FADE}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;
