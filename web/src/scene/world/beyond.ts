// The land around the world: only a backdrop, so that the scene has a horizon where the world ends.
// It is paler than the world's own ground, and no sensor of the simulation sees it.

import { BufferAttribute, BufferGeometry, type Color, Mesh, type Material } from "three";
import { worldMaterial } from "./materials.ts";

/** How far it reaches outwards, m: a slope that levels the border out, then a plain. */
const SLOPE_M = 160;
const PLAIN_M = 3600;
/** Share of the ground's extent within which a corner lies on the border. */
const ON_BORDER = 1e-5;

/** A border that runs along a side of the ground: its two ends, m. */
type Edge = readonly [ax: number, ay: number, az: number, bx: number, by: number, bz: number];

interface Box {
  left: number;
  right: number;
  bottom: number;
  top: number;
}

/** The backdrop around such ground (nine numbers a triangle, m); null: its border is no rectangle. */
export function backdropOf(corners: Float64Array, colour: Color): Mesh | null {
  const geometry = landAround(corners);
  if (geometry === null) return null;
  const material = worldMaterial("beyond", colour, null, false) as Material;
  const mesh = new Mesh(geometry, material);
  mesh.receiveShadow = false;
  return mesh;
}

/** Its surface, from the border outwards; `base` is 0 on the border and 1 where it ends. */
export function landAround(corners: Float64Array): BufferGeometry | null {
  const box = boxOf(corners);
  const edges = box === null ? [] : edgesOf(corners, box);
  if (box === null || edges.length < 4) return null;
  const level = edges.reduce((sum, [, , az, , , bz]) => sum + 0.5 * (az + bz), 0) / edges.length;
  const position: number[] = [];
  const base: number[] = [];
  const index: number[] = [];
  for (const [ax, ay, az, bx, by, bz] of edges) {
    const first = base.length;
    for (const [x, y, z] of [
      [ax, ay, az],
      [bx, by, bz],
    ] as const)
      for (const [away, height] of [
        [0, z],
        [SLOPE_M, level],
        [PLAIN_M, level],
      ] as const) {
        position.push(...outwards(x, y, box, away), height);
        base.push(away / PLAIN_M);
      }
    for (const at of [first, first + 1]) index.push(at, at + 1, at + 3, at + 3, at + 1, at + 4);
  }
  faceUpwards(position, index);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(Float32Array.from(position), 3));
  geometry.setAttribute("base", new BufferAttribute(Float32Array.from(base), 1));
  geometry.setIndex(index);
  geometry.computeVertexNormals();
  return geometry;
}

function boxOf(corners: Float64Array): Box | null {
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (let i = 0; i < corners.length; i += 3) {
    box.left = Math.min(box.left, corners[i]!);
    box.right = Math.max(box.right, corners[i]!);
    box.bottom = Math.min(box.bottom, corners[i + 1]!);
    box.top = Math.max(box.top, corners[i + 1]!);
  }
  return box.right > box.left && box.top > box.bottom ? box : null;
}

/** Sides of triangles that lie on a side of the box. */
function edgesOf(corners: Float64Array, box: Box): Edge[] {
  const near = ON_BORDER * Math.max(box.right - box.left, box.top - box.bottom);
  const on = (a: number, b: number, border: number) =>
    Math.abs(a - border) < near && Math.abs(b - border) < near;
  const edges: Edge[] = [];
  for (let t = 0; t + 9 <= corners.length; t += 9)
    for (const [i, j] of [
      [t, t + 3],
      [t + 3, t + 6],
      [t + 6, t],
    ] as const) {
      const [ax, ay, az] = [corners[i]!, corners[i + 1]!, corners[i + 2]!];
      const [bx, by, bz] = [corners[j]!, corners[j + 1]!, corners[j + 2]!];
      const level = on(ay, by, box.bottom) || on(ay, by, box.top);
      const upright = on(ax, bx, box.left) || on(ax, bx, box.right);
      if (level || upright) edges.push([ax, ay, az, bx, by, bz]);
    }
  return edges;
}

/** A position on the border, moved away from the middle until that many metres outside the box. */
function outwards(x: number, y: number, { left, right, bottom, top }: Box, away: number) {
  const [middleX, middleY] = [0.5 * (left + right), 0.5 * (bottom + top)];
  const [wide, deep] = [0.5 * (right - left), 0.5 * (top - bottom)];
  return [
    middleX + ((x - middleX) * (wide + away)) / wide,
    middleY + ((y - middleY) * (deep + away)) / deep,
  ] as const;
}

/** Turn round what is seen from below only. */
function faceUpwards(position: readonly number[], index: number[]): void {
  for (let t = 0; t < index.length; t += 3) {
    const [a, b, c] = [3 * index[t]!, 3 * index[t + 1]!, 3 * index[t + 2]!];
    const along = (from: number, to: number, axis: number) =>
      position[to + axis]! - position[from + axis]!;
    const turn = along(a, b, 0) * along(a, c, 1) - along(a, b, 1) * along(a, c, 0);
    if (turn < 0) [index[t + 1], index[t + 2]] = [index[t + 2]!, index[t + 1]!];
  }
}
