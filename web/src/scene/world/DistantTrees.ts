import {
  BufferAttribute,
  DynamicDrawUsage,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  ShaderMaterial,
  Sphere,
  UniformsLib,
  UniformsUtils,
  Vector2,
  Vector3,
  type BufferGeometry,
  type WebGLRenderer,
} from "three";
import type { Air } from "../air/air.ts";
import { FADE } from "../air/fog.ts";
import type { Model, Surface } from "./readWorld.ts";
import type { Chosen } from "./treeCells.ts";
import { ELEVATIONS, renderImpostors, type TreeImpostors } from "./treeImpostors.ts";

/** Trees far away: one draw call for all of them, each an impostor of its model that faces the camera. */
export class DistantTrees {
  readonly object: Mesh<InstancedBufferGeometry, ShaderMaterial>;
  /** Of all models, foot to farthest point, m. */
  readonly tallest: number;
  private readonly spheres: Sphere[];
  private readonly impostors: TreeImpostors;
  private shown = -1;

  constructor(
    shapes: readonly (readonly Surface[])[],
    private readonly models: readonly Model[],
    private readonly air: Air,
    renderer: WebGLRenderer,
  ) {
    this.spheres = shapes.map((parts) => around(parts.map(({ geometry }) => geometry)));
    this.tallest = Math.max(
      0,
      ...this.spheres.map(({ center, radius }) => center.length() + radius),
    );
    this.impostors = renderImpostors(shapes, this.spheres, renderer);
    const total = models.reduce((sum, { transforms }) => sum + transforms.length / 16, 0);
    this.object = new Mesh(quads(total), this.material());
    this.object.frustumCulled = false;
  }

  update(): void {
    if (this.shown === this.air.version) return;
    this.shown = this.air.version;
    const { uniforms } = this.object.material;
    const { light } = this.air;
    for (const name of ["sun", "above", "below", "towardsLight"] as const)
      uniforms[name]!.value.set(...light[name]);
  }

  plant(chosen: readonly Chosen[]): void {
    const { geometry } = this.object;
    const origin = geometry.getAttribute("origin") as InstancedBufferAttribute;
    const look = geometry.getAttribute("look") as InstancedBufferAttribute;
    let count = 0;
    chosen.forEach(({ distant }, model) => {
      const { center, radius } = this.spheres[model]!;
      const { transforms } = this.models[model]!;
      for (const tree of distant) {
        const m = 16 * tree;
        const wide = Math.hypot(transforms[m]!, transforms[m + 1]!, transforms[m + 2]!);
        const tall = Math.hypot(transforms[m + 8]!, transforms[m + 9]!, transforms[m + 10]!);
        origin.setXYZ(
          count,
          transforms[m + 12]!,
          transforms[m + 13]!,
          transforms[m + 14]! + tall * center.z,
        );
        look.setXYZ(count, 2 * radius * wide, 2 * radius * tall, model);
        count++;
      }
    });
    geometry.instanceCount = count;
    this.object.visible = count > 0;
    for (const attribute of [origin, look]) {
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, attribute.itemSize * count);
      attribute.needsUpdate = true;
    }
  }

  dispose(): void {
    this.object.geometry.dispose();
    this.object.material.dispose();
    this.impostors.texture.dispose();
  }

  private material(): ShaderMaterial {
    const vector = () => ({ value: new Vector3() });
    const uniforms = UniformsUtils.merge([
      UniformsLib.fog,
      { sun: vector(), above: vector(), below: vector(), towardsLight: vector() },
      {
        tiles: { value: new Vector2(this.models.length, ELEVATIONS.length) },
        impostors: { value: null },
      },
    ]);
    uniforms.impostors!.value = this.impostors.texture;
    return new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms,
      fog: true,
    });
  }
}

function quads(count: number): InstancedBufferGeometry {
  const geometry = new InstancedBufferGeometry();
  const corners = new Float32Array([-0.5, -0.5, 0, 0.5, -0.5, 0, 0.5, 0.5, 0, -0.5, 0.5, 0]);
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  for (const name of ["origin", "look"]) {
    const attribute = new InstancedBufferAttribute(new Float32Array(3 * count), 3);
    geometry.setAttribute(name, attribute.setUsage(DynamicDrawUsage));
  }
  return geometry;
}

/** A sphere around the axis of a tree that holds all of it. */
function around(geometries: readonly BufferGeometry[]): Sphere {
  const points: Vector3[] = [];
  for (const geometry of geometries) {
    const position = geometry.getAttribute("position");
    for (let i = 0; i < position.count; i++)
      points.push(new Vector3().fromBufferAttribute(position, i));
  }
  let [low, high] = [Infinity, -Infinity];
  for (const { z } of points) [low, high] = [Math.min(low, z), Math.max(high, z)];
  const center = new Vector3(0, 0, points.length > 0 ? 0.5 * (low + high) : 0);
  const radius = points.reduce((max, point) => Math.max(max, center.distanceTo(point)), 0);
  return new Sphere(center, radius);
}

const VERTEX = /* glsl */ `
#include <fog_pars_vertex>
attribute vec3 origin, look;
uniform vec2 tiles;
varying vec2 vLow, vHigh, vIn;
varying float vBlend, vHue;
varying vec3 vRight, vUp, vTowards;
void main() {
  vec3 towards = normalize(cameraPosition - origin);
  vec3 right = normalize(cross(vec3(0.0, 0.0, 1.0), towards) + vec3(1e-5, 0.0, 0.0));
  vec3 up = cross(towards, right);
  // The taller tree is stretched along its trunk, however much of that is seen.
  float tall = mix(look.y, look.x, abs(towards.z));
  vHue = fract(sin(dot(origin.xy, vec2(12.9898, 78.233))) * 43758.5453);
  vec3 world = origin + right * position.x * look.x + up * position.y * tall;
  float row = clamp(asin(clamp(towards.z, 0.0, 1.0)) * ${(180 / Math.PI).toFixed(4)} / ${ELEVATIONS[1]!.toFixed(1)}, 0.0, tiles.y - 1.001);
  vec2 uv = position.xy + 0.5;
  if (vHue > 0.5) uv.x = 1.0 - uv.x;
  vIn = position.xy;
  vLow = (vec2(look.z, floor(row)) + uv) / tiles;
  vHigh = (vec2(look.z, floor(row) + 1.0) + uv) / tiles;
  vBlend = fract(row);
  vRight = right; vUp = up; vTowards = towards;
  vec4 mvPosition = viewMatrix * vec4(world, 1.0);
  gl_Position = projectionMatrix * mvPosition;
  #include <fog_vertex>
}
`;

const FRAGMENT = /* glsl */ `
#include <common>
#include <fog_pars_fragment>
uniform sampler2D impostors;
uniform vec3 sun, above, below, towardsLight;
varying vec2 vLow, vHigh, vIn;
varying float vBlend, vHue;
varying vec3 vRight, vUp, vTowards;
void main() {
  vec4 tree = mix(texture2D(impostors, vLow), texture2D(impostors, vHigh), vBlend);
  if (tree.a < 0.35) discard;
  vec3 colour = tree.rgb / tree.a;
  if (colour.g > colour.r) colour *= mix(vec3(1.0), vec3(1.35, 1.12, 0.75), 0.5 * vHue);
  vec3 normal = normalize(vRight * vIn.x * 2.0 + vUp * (vIn.y * 2.0 + 0.3) + vTowards * 0.7);
  float facing = dot(normal, towardsLight);
  vec3 light = sun * max(0.0, 0.85 * facing + 0.1) + mix(below, above, 0.5 + 0.5 * normal.z) * 1.15;
  light *= mix(0.55, 1.0, smoothstep(-0.5, 0.35, vIn.y));
  gl_FragColor = vec4(colour * light * RECIPROCAL_PI, 1.0);
  ${FADE}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;
