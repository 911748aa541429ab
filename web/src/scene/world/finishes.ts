import { ownEntry } from "../../lib/ownEntry.ts";

// What surfaces look like close up, by the names of `volery.world.materials`. Each is a few lines of
// shader that change what the glTF says: `colour` and `rough` may be set, `height` (m) makes relief,
// `glow` is light of its own, `vanish` (0 to 1) how much of it is lost in the haze. At hand are `mapPosition` (m), `own` (m, in the shape's own axes),
// `facing` (the surface's normal, map), `night` (0 to 1) and `noise(uv)`, see `noiseTexture.ts`.

export interface Finish {
  roughness: number;
  metalness?: number;
  shader: string;
  /** Moves in the wind. */
  sways?: boolean;
  /** Made of leaves: lit from both sides, cut out by an image of leaves. */
  leafy?: boolean;
  /** Fades into the haze by itself, by `vanish`. */
  vanishes?: boolean;
}

const GROUND = /* glsl */ `
  vec4 wide = noise(mapPosition.xy / 61.0), middle = noise(mapPosition.xy / 9.0 + wide.r), close = noise(mapPosition.xy / 1.7);
  float grass = smoothstep(0.3, 0.56, 0.5 * wide.r + 0.35 * middle.r + 0.15 * close.g);
  grass *= smoothstep(0.55, 0.8, facing.z);
  vec3 soil = colour * mix(vec3(0.75, 0.62, 0.6), vec3(1.5, 1.2, 1.1), close.g * 0.6 + middle.g * 0.4);
  vec3 blades = mix(vec3(0.055, 0.1, 0.024), vec3(0.16, 0.23, 0.06), close.g * 0.7 + middle.g * 0.3);
  blades = mix(blades, vec3(0.22, 0.21, 0.085), 0.5 * smoothstep(0.55, 0.9, middle.a));
  colour = mix(soil, blades, grass);
  height = 0.05 * close.g + 0.02 * noise(mapPosition.xy / 0.41).g;
`;

/** As the ground, paler from the border on and gone into the haze where it ends. */
const BEYOND = `${GROUND}
  vec3 pale = mix(colour, vec3(dot(colour, vec3(0.33))), 0.35) * 1.15;
  colour = mix(colour, pale, smoothstep(0.0, 0.004, vBase));
  vanish = 1.0 - exp(-5.5 * vBase);
  height *= 1.0 - vanish;
`;

const COVER = /* glsl */ `
  vec4 middle = noise(mapPosition.xy / 11.0), close = noise(mapPosition.xy / 1.3);
  float green = smoothstep(0.02, 0.1, colour.g - 0.5 * (colour.r + colour.b));
  colour *= mix(0.85 + 0.3 * close.g, 0.6 + 0.5 * close.g + 0.35 * middle.r, green);
  height = mix(0.004, 0.04, green) * close.g;
`;

const WOOD = /* glsl */ `
  float round = atan(own.y, own.x);
  vec4 bark = noise(vec2(round * 0.9, own.z * 0.35)), fine = noise(vec2(own.x + own.y, own.z) * 1.3);
  float ridge = smoothstep(0.25, 0.75, bark.b * 0.7 + fine.g * 0.3);
  colour *= mix(vec3(0.45, 0.42, 0.4), vec3(1.5, 1.45, 1.4), ridge);
  colour = mix(colour, vec3(0.07, 0.1, 0.03), 0.45 * smoothstep(0.5, 0.8, noise(own.xz * 0.4).r));
  height = 0.02 * ridge;
`;

const LEAF = /* glsl */ `
  float shade = noise(own.xy * 0.11 + own.z * 0.07).r;
  colour *= mix(0.55, 1.5, shade);
  colour = mix(colour, colour * vec3(1.7, 1.25, 0.5), 0.5 * treeHue);
`;

/** Panes in a lattice of storeys and bays as the cameras see them (`facade_kernels.py`), some lit at night. */
const FACADE = /* glsl */ `
  vec2 level = normalize(facing.yx * vec2(-1.0, 1.0) + 1e-5);
  vec2 wall = vec2(dot(mapPosition.xy, level) / 2.6, above / 3.1);
  vec2 cell = floor(wall), blur = max(fwidth(wall), 1e-4);
  float steep = 1.0 - smoothstep(0.3, 0.6, abs(facing.z));
  bool shop = cell.y < 0.5;
  vec2 half_ = shop ? vec2(0.385, 0.32) : vec2(0.25, 0.26);
  vec2 away = abs(fract(wall) - vec2(0.5, shop ? 0.45 : 0.55));
  vec2 within = clamp((half_ - away) / blur + 0.5, 0.0, 1.0);
  float frame = clamp((0.016 - away.x) / blur.x + 0.5, 0.0, 1.0) * min(1.0, 0.016 / blur.x);
  float far = clamp(length(blur) * 1.2, 0.0, 1.0);
  float pane = mix(within.x * within.y * (1.0 - frame), 4.0 * half_.x * half_.y, far) * steep * step(0.0, above);
  float chance = fract(sin(dot(cell + floor(facing.xy * 7.0), vec2(12.9898, 78.233))) * 43758.5453);
  vec4 plaster = noise(wall * 0.7);
  colour *= 0.85 + 0.25 * plaster.r - 0.12 * (1.0 - smoothstep(0.0, 0.6, above));
  vec3 glass = mix(vec3(0.03, 0.045, 0.06), vec3(0.16, 0.2, 0.25), chance * 0.7);
  colour = mix(colour, glass, pane);
  rough = mix(rough, 0.12, pane);
  glow = pane * night * step(0.62, chance) * mix(vec3(1.0, 0.72, 0.38), vec3(0.9, 0.92, 1.0), fract(chance * 7.0)) * 0.55;
`;

const ROOF = /* glsl */ `
  vec4 spots = noise(mapPosition.xy / 6.0), fine = noise(mapPosition.xy / 0.9);
  colour *= 0.75 + 0.3 * spots.r + 0.2 * fine.g;
  height = 0.01 * fine.g;
`;

const PLASTER = /* glsl */ `
  vec3 side = abs(facing);
  vec2 flat_ = side.z > 0.6 ? mapPosition.xy : vec2(mapPosition.x + mapPosition.y, mapPosition.z);
  vec4 spots = noise(flat_ / 5.0), fine = noise(flat_ / 0.8);
  colour *= 0.82 + 0.22 * spots.r + 0.14 * fine.g;
  height = 0.004 * fine.g;
`;

const ASPHALT = /* glsl */ `
  vec4 spots = noise(mapPosition.xy / 7.0), fine = noise(mapPosition.xy / 0.5);
  colour *= 0.7 + 0.3 * spots.r + 0.35 * fine.g;
  height = 0.003 * fine.g;
`;

const PAVING = /* glsl */ `
  vec2 slab = fract(mapPosition.xy / 0.6), cell = floor(mapPosition.xy / 0.6);
  float blur = clamp(length(fwidth(mapPosition.xy / 0.6)), 0.0, 1.0);
  float joint = min(min(slab.x, slab.y), min(1.0 - slab.x, 1.0 - slab.y));
  colour *= mix(mix(0.6, 1.0, smoothstep(0.01, 0.04, joint)), 0.95, blur);
  colour *= 0.85 + 0.3 * fract(sin(dot(cell, vec2(127.1, 311.7))) * 43758.5453) * (1.0 - blur);
  colour *= 0.85 + 0.25 * noise(mapPosition.xy / 3.0).r;
`;

const GRAIN = /* glsl */ `
  colour *= 0.9 + 0.2 * noise(vec2(mapPosition.x + mapPosition.y, mapPosition.z) / 1.5).r;
`;

const PLAIN_FINISH: Finish = { roughness: 0.85, shader: GRAIN };

const FINISHES: Record<string, Finish> = {
  ground: { roughness: 0.95, shader: GROUND },
  beyond: { roughness: 0.95, shader: BEYOND, vanishes: true },
  ground_cover: { roughness: 0.92, shader: COVER },
  wood: { roughness: 0.9, shader: WOOD, sways: true },
  leaf: { roughness: 0.7, shader: LEAF, sways: true, leafy: true },
  facade: { roughness: 0.85, shader: FACADE },
  roof: { roughness: 0.9, shader: ROOF },
  wall: { roughness: 0.9, shader: PLASTER },
  block: { roughness: 0.8, shader: PLASTER },
  asphalt: { roughness: 0.9, shader: ASPHALT },
  paving: { roughness: 0.85, shader: PAVING },
  metal: { roughness: 0.5, metalness: 0.4, shader: GRAIN },
  painted: { roughness: 0.6, shader: GRAIN },
};

export function finishOf(material: string): Finish {
  return ownEntry(FINISHES, material.toLowerCase().replace(/[._]?\d+$/, "")) ?? PLAIN_FINISH;
}
