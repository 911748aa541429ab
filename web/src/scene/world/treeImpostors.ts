import {
  Color,
  DoubleSide,
  HalfFloatType,
  LinearFilter,
  LinearMipmapLinearFilter,
  Mesh,
  MeshBasicMaterial,
  OrthographicCamera,
  Scene,
  WebGLRenderTarget,
  type Sphere,
  type Texture,
  type WebGLRenderer,
} from "three";
import { finishOf } from "./finishes.ts";
import { worldUniforms } from "./materials.ts";
import type { Surface } from "./readWorld.ts";

/** From so many degrees above the horizon each model is rendered; evenly spaced from 0. */
export const ELEVATIONS = [0, 30, 60, 90] as const;
const SIDE = 128;

export interface TreeImpostors {
  /** A column for each model, a row for each elevation; colour times opacity, without light. */
  texture: Texture;
}

/** Render impostors of all models, as they are without light. */
export function renderImpostors(
  shapes: readonly (readonly Surface[])[],
  spheres: readonly Sphere[],
  renderer: WebGLRenderer,
): TreeImpostors {
  const target = new WebGLRenderTarget(SIDE * shapes.length, SIDE * ELEVATIONS.length, {
    type: HalfFloatType,
    generateMipmaps: true,
    minFilter: LinearMipmapLinearFilter,
    magFilter: LinearFilter,
  });
  const before = {
    target: renderer.getRenderTarget(),
    colour: renderer.getClearColor(new Color()),
    alpha: renderer.getClearAlpha(),
    auto: renderer.autoClear,
  };
  const camera = new OrthographicCamera();
  camera.up.set(0, 0, 1);
  renderer.setRenderTarget(target);
  renderer.setClearColor(0x000000, 0);
  renderer.clear();
  renderer.autoClear = false;
  shapes.forEach((parts, column) => {
    const scene = stage(parts);
    ELEVATIONS.forEach((degrees, row) => {
      aim(camera, spheres[column]!, (degrees * Math.PI) / 180);
      target.viewport.set(column * SIDE, row * SIDE, SIDE, SIDE);
      target.scissor.set(column * SIDE, row * SIDE, SIDE, SIDE);
      target.scissorTest = true;
      renderer.setRenderTarget(target);
      renderer.render(scene, camera);
    });
    for (const mesh of scene.children) ((mesh as Mesh).material as MeshBasicMaterial).dispose();
  });
  renderer.autoClear = before.auto;
  renderer.setRenderTarget(before.target);
  renderer.setClearColor(before.colour, before.alpha);
  return { texture: target.texture };
}

function stage(parts: readonly Surface[]): Scene {
  const scene = new Scene();
  for (const { geometry, material, colour } of parts) {
    const flat = new MeshBasicMaterial({ color: colour, side: DoubleSide, toneMapped: false });
    if (finishOf(material).leafy) flat.onBeforeCompile = cutLeaves;
    scene.add(new Mesh(geometry, flat));
  }
  return scene;
}

/** Leaves as in `materials.ts`, with the shade that they have within the crown. */
function cutLeaves(shader: {
  vertexShader: string;
  fragmentShader: string;
  uniforms: object;
}): void {
  Object.assign(shader.uniforms, worldUniforms);
  shader.vertexShader = shader.vertexShader
    .replace("#include <common>", "#include <common>\nvarying vec2 vLeaf;\nvarying vec3 vOwn;")
    .replace("#include <begin_vertex>", "#include <begin_vertex>\nvLeaf = uv;\nvOwn = position;");
  shader.fragmentShader = shader.fragmentShader
    .replace(
      "#include <common>",
      "#include <common>\nvarying vec2 vLeaf;\nvarying vec3 vOwn;\nuniform sampler2D noiseMap, leafMap;",
    )
    .replace(
      "#include <color_fragment>",
      `#include <color_fragment>
       vec4 leaves = texture2D(leafMap, vLeaf);
       if (leaves.a < 0.4) discard;
       diffuseColor.rgb *= leaves.rgb * 1.6 * mix(0.55, 1.5, texture2D(noiseMap, vOwn.xy * 0.11 + vOwn.z * 0.07).r);`,
    );
}

function aim(camera: OrthographicCamera, { center, radius }: Sphere, elevation: number): void {
  camera.left = camera.bottom = -radius;
  camera.right = camera.top = radius;
  camera.near = 0;
  camera.far = 4 * radius;
  camera.updateProjectionMatrix();
  camera.up.set(0, elevation > 1.5 ? 1 : 0, elevation > 1.5 ? 0 : 1);
  const away = 2 * radius;
  camera.position.set(0, -away * Math.cos(elevation), center.z + away * Math.sin(elevation));
  camera.lookAt(0, 0, center.z);
  camera.updateMatrixWorld();
}
