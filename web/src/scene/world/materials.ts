import {
  DoubleSide,
  FrontSide,
  MeshLambertMaterial,
  MeshStandardMaterial,
  Vector2,
  type Color,
  type Texture,
  type WebGLProgramParametersWithUniforms,
} from "three";
import { finishOf, type Finish } from "./finishes.ts";
import { makeLeaves } from "./leafTexture.ts";
import { makeNoise } from "./noiseTexture.ts";

/** Numbers of the frame that all materials of the world share. */
export const worldUniforms = {
  noiseMap: { value: null as Texture | null },
  leafMap: { value: null as Texture | null },
  timeS: { value: 0 },
  /** Mean wind, map, m/s. */
  windMap: { value: new Vector2() },
  nightShare: { value: 0 },
};

let plain = false;

/** Once, before the first world: `software` where the processor draws. */
export function prepareMaterials(software: boolean): void {
  plain = software;
  worldUniforms.noiseMap.value ??= makeNoise(software ? 1 : 4);
  worldUniforms.leafMap.value ??= makeLeaves();
}

/** The material of that name of the world's glTF; its colours stand in the vertices where `coloured`. */
export function worldMaterial(
  name: string,
  colour: Color,
  map: Texture | null,
  coloured: boolean,
): MeshStandardMaterial | MeshLambertMaterial {
  const finish = finishOf(name);
  const common = {
    color: colour,
    map,
    vertexColors: coloured,
    side: finish.leafy ? DoubleSide : FrontSide,
    name,
  };
  const { roughness, metalness = 0 } = finish;
  const material = plain
    ? new MeshLambertMaterial(common)
    : new MeshStandardMaterial({ ...common, roughness, metalness });
  material.onBeforeCompile = (shader) => finishShader(shader, finish);
  material.customProgramCacheKey = () => `${name} ${plain}`;
  return material;
}

function finishShader(shader: WebGLProgramParametersWithUniforms, finish: Finish): void {
  Object.assign(shader.uniforms, worldUniforms);
  const base = shader.vertexShader.includes("attribute float base") ? "" : BASE;
  shader.vertexShader = shader.vertexShader
    .replace("#include <common>", `#include <common>\n${base}${VERTEX_HEAD}`)
    .replace("#include <project_vertex>", vertexBody(finish));
  shader.fragmentShader = shader.fragmentShader
    .replace("#include <common>", `#include <common>\n${FRAGMENT_HEAD}`)
    .replace("#include <color_fragment>", `#include <color_fragment>\n${fragmentBody(finish)}`)
    .replace(
      "#include <emissivemap_fragment>",
      "#include <emissivemap_fragment>\ntotalEmissiveRadiance += glow;",
    )
    .replace(
      "#include <opaque_fragment>",
      `#include <opaque_fragment>\n${finish.vanishes ? VANISH : ""}`,
    )
    .replace("#include <roughnessmap_fragment>", plain ? "" : "float roughnessFactor = rough;")
    .replace(
      "#include <normal_fragment_maps>",
      `#include <normal_fragment_maps>\n${relief(finish)}`,
    );
}

const VANISH = /* glsl */ `
#ifdef USE_FOG
  gl_FragColor.rgb = mix(gl_FragColor.rgb, hazeLight, vanish);
#endif
`;

const BASE = "attribute float base;\n";

const VERTEX_HEAD = /* glsl */ `
varying vec3 vMapPosition, vOwn, vFacing;
varying float vAbove, vBase, vHue;
varying vec2 vLeaf;
uniform float timeS;
uniform vec2 windMap;
`;

/** As three's `project_vertex`, with the position in the map in between. */
function vertexBody({ sways, leafy }: Finish): string {
  return /* glsl */ `
  vec4 mapPosition = vec4(transformed, 1.0);
  vec3 facing = normal;
  vec3 foot = vec3(0.0);
  #ifdef USE_INSTANCING
    mapPosition = instanceMatrix * mapPosition;
    facing = mat3(instanceMatrix) * facing;
    foot = (modelMatrix * instanceMatrix[3]).xyz;
  #endif
  mapPosition = modelMatrix * mapPosition;
  vFacing = normalize(mat3(modelMatrix) * facing);
  vOwn = position;
  vBase = base;
  vAbove = mapPosition.z - base;
  vHue = fract(sin(dot(foot.xy, vec2(12.9898, 78.233))) * 43758.5453);
  ${sways ? SWAY : ""}
  ${leafy ? "vLeaf = uv;\n" + FLUTTER : ""}
  vMapPosition = mapPosition.xyz;
  vec4 mvPosition = viewMatrix * mapPosition;
  gl_Position = projectionMatrix * mvPosition;
  `;
}

/** A tree bends with the square of the height; gusts run through the forest with the wind. */
const SWAY = /* glsl */ `
  #ifdef USE_INSTANCING
    float speed = length(windMap);
    float tall = mapPosition.z - foot.z;
    float phase = dot(foot.xy, windMap) * 0.05 / max(speed, 0.5) - timeS * (0.5 + 0.05 * speed);
    float gust = 0.6 + 0.4 * sin(phase) + 0.25 * sin(2.7 * phase + 6.3 * vHue);
    mapPosition.xy += windMap * gust * tall * tall * 0.00022;
  #endif
`;

const FLUTTER = /* glsl */ `
  float quick = timeS * (2.0 + 0.5 * speed) + dot(position, vec3(3.1, 2.3, 1.7)) + 20.0 * vHue;
  mapPosition.xyz += vec3(sin(quick), sin(1.3 * quick + 1.0), 0.6 * sin(1.7 * quick)) * min(0.012 * speed, 0.09);
`;

const FRAGMENT_HEAD = /* glsl */ `
varying vec3 vMapPosition, vOwn, vFacing;
varying float vAbove, vBase, vHue;
varying vec2 vLeaf;
uniform sampler2D noiseMap, leafMap;
uniform float nightShare;
vec4 noise(vec2 uv) { return texture2D(noiseMap, uv); }
`;

function fragmentBody({ roughness, shader, leafy }: Finish): string {
  return /* glsl */ `
  vec3 mapPosition = vMapPosition, own = vOwn, facing = normalize(vFacing), colour = diffuseColor.rgb, glow = vec3(0.0);
  float above = vAbove, night = nightShare, height = 0.0, vanish = 0.0, treeHue = vHue, rough = ${roughness.toFixed(3)};
  ${leafy ? "vec4 leaves = texture2D(leafMap, vLeaf);\n  if (leaves.a < 0.4) discard;\n  colour *= leaves.rgb * 1.6;" : ""}
  { ${shader} }
  diffuseColor.rgb = colour;
  `;
}

/** The normal that the relief gives (Mikkelsen 2010, unparametrized bump maps); leaves keep their crown's. */
function relief({ leafy, shader }: Finish): string {
  if (leafy)
    return "normal = normalize(vNormal);\nif (dot(normal, normalize(vViewPosition)) < 0.0) normal = mix(normal, -normal, 0.35);";
  if (plain || !shader.includes("height =")) return "";
  return /* glsl */ `
  {
    vec3 across = dFdx(- vViewPosition), up = dFdy(- vViewPosition);
    vec3 r1 = cross(up, normal), r2 = cross(normal, across);
    float det = dot(across, r1) * faceDirection;
    vec3 slope = sign(det) * (dFdx(height) * r1 + dFdy(height) * r2);
    normal = normalize(abs(det) * normal - slope);
  }
  `;
}
