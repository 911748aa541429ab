import {
  DataTexture,
  LinearFilter,
  LinearMipmapLinearFilter,
  RepeatWrapping,
  RGBAFormat,
} from "three";

const SIDE = 256;

/**
 * Four channels of noise that repeats without a seam, made once: r clouds, g fine grains, b streaks
 * along v, a cells. A texture costs a fraction of noise in the shader and fades with the distance.
 */
export function makeNoise(anisotropy: number): DataTexture {
  const data = new Uint8Array(SIDE * SIDE * 4);
  const clouds = layers([4, 8, 16, 32, 64]);
  const grains = layers([48, 96, 128]);
  const streaks = layers([32, 64, 128], 8);
  const cells = layers([16, 24]);
  for (let i = 0; i < SIDE * SIDE; i++) {
    data[4 * i] = clouds[i]! * 255;
    data[4 * i + 1] = grains[i]! * 255;
    data[4 * i + 2] = streaks[i]! * 255;
    data[4 * i + 3] = cells[i]! * 255;
  }
  const texture = new DataTexture(data, SIDE, SIDE, RGBAFormat);
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.magFilter = LinearFilter;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.anisotropy = anisotropy;
  texture.needsUpdate = true;
  return texture;
}

/** Sum of smooth noises with so many lattice cells a side, each half as strong, spread over 0..1. */
function layers(cells: number[], stretch = 1): Float32Array {
  const sum = new Float32Array(SIDE * SIDE);
  cells.forEach((count, k) =>
    addNoise(sum, count, Math.max(1, Math.round(count / stretch)), 0.5 ** k),
  );
  let low = Infinity;
  let high = -Infinity;
  for (const value of sum) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return sum.map((value) => (value - low) / (high - low));
}

function addNoise(sum: Float32Array, across: number, along: number, weight: number): void {
  const random = randoms(across * 7919 + along);
  const lattice = Float32Array.from({ length: across * along }, random);
  for (let y = 0; y < SIDE; y++) {
    const v = (y / SIDE) * along;
    const j = Math.floor(v);
    const fy = fade(v - j);
    for (let x = 0; x < SIDE; x++) {
      const u = (x / SIDE) * across;
      const i = Math.floor(u);
      const fx = fade(u - i);
      const at = (di: number, dj: number) =>
        lattice[((j + dj) % along) * across + ((i + di) % across)]!;
      const lower = at(0, 0) + fx * (at(1, 0) - at(0, 0));
      const upper = at(0, 1) + fx * (at(1, 1) - at(0, 1));
      sum[y * SIDE + x]! += weight * (lower + fy * (upper - lower));
    }
  }
}

function fade(t: number): number {
  return t * t * (3 - 2 * t);
}

/** The same numbers in every page (mulberry32). */
export function randoms(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}
