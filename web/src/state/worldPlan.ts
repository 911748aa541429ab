// The world from above, for the map and for clicks on the ground: made once when a world is shown.

import { Matrix4, Vector3, type BufferGeometry } from "three";
import { create } from "zustand";
import { heightIn, heightsOf, type Heights, type Triangles } from "../lib/heights.ts";

export interface Tree {
  x: number;
  y: number;
  /** Radius of what is drawn, m. */
  crown: number;
  /** Radius of the trunk, m. */
  trunk: number;
}

export interface WorldPlan {
  ground: Heights | null;
  trees: Tree[];
  /** Surfaces of buildings and blocks that face upwards. */
  roofs: Triangles;
}

/** A world as the scene reads it: z up, in the map. */
export interface PlanSource {
  /** What stands once, with its transform. */
  solids: readonly { geometry: BufferGeometry; material: string; transform: Matrix4 }[];
  /** What stands many times: transforms, 16 numbers each. */
  models: readonly { parts: readonly { geometry: BufferGeometry }[]; transforms: Float32Array }[];
}

const MAX_CELLS = 384;
/** Below this height a tree is its trunk, m. */
const TRUNK_TOP_M = 1.5;
/** Minimum upward part of the normal of a roof. */
const UPWARD = 0.2;

export const useWorldPlan = create<{ plan: WorldPlan | null }>(() => ({ plan: null }));

/** Take a world that is shown from now on; null: none. */
export function planWorld(world: PlanSource | null): void {
  useWorldPlan.setState({ plan: world === null ? null : planOf(world) });
}

export function planOf({ solids, models }: PlanSource): WorldPlan {
  const ground: number[] = [];
  const roofs: number[] = [];
  for (const { geometry, material, transform } of solids) {
    if (material.startsWith("ground")) addTriangles(geometry, transform, ground, -1);
    else addTriangles(geometry, transform, roofs, UPWARD);
  }
  return {
    ground: heightsOf(new Float32Array(ground), MAX_CELLS),
    trees: models.flatMap(treesOf),
    roofs: new Float32Array(roofs),
  };
}

/** Height of the ground, m; 0 where there is none. */
export function heightAt(x: number, y: number): number {
  const ground = useWorldPlan.getState().plan?.ground ?? null;
  const height = ground === null ? 0 : heightIn(ground, x, y);
  return Number.isNaN(height) ? 0 : height;
}

/** Triangles in the map whose normals point up at least so much. */
function addTriangles(
  geometry: BufferGeometry,
  transform: Matrix4,
  into: number[],
  upward: number,
): void {
  const position = geometry.getAttribute("position");
  const index = geometry.getIndex();
  const count = index?.count ?? position.count;
  const corners = [new Vector3(), new Vector3(), new Vector3()] as const;
  const [one, other] = [new Vector3(), new Vector3()];
  for (let i = 0; i + 3 <= count; i += 3) {
    corners.forEach((corner, k) => {
      corner.fromBufferAttribute(position, index?.getX(i + k) ?? i + k).applyMatrix4(transform);
    });
    const [a, b, c] = corners;
    const normal = one.subVectors(b, a).cross(other.subVectors(c, a));
    if (normal.z < upward * normal.length()) continue;
    for (const { x, y, z } of corners) into.push(x, y, z);
  }
}

function treesOf({ parts, transforms }: PlanSource["models"][number]): Tree[] {
  const { crown, trunk } = radiiOf(parts.map(({ geometry }) => geometry));
  return Array.from({ length: transforms.length / 16 }, (_, i) => {
    const at = 16 * i;
    const scale = Math.hypot(transforms[at]!, transforms[at + 1]!, transforms[at + 2]!);
    const [x, y] = [transforms[at + 12]!, transforms[at + 13]!];
    return { x, y, crown: crown * scale, trunk: trunk * scale };
  });
}

function radiiOf(geometries: readonly BufferGeometry[]): { crown: number; trunk: number } {
  let [crown, trunk] = [0, 0];
  for (const geometry of geometries) {
    const position = geometry.getAttribute("position");
    for (let i = 0; i < position.count; i++) {
      const radius = Math.hypot(position.getX(i), position.getY(i));
      crown = Math.max(crown, radius);
      if (position.getZ(i) < TRUNK_TOP_M) trunk = Math.max(trunk, radius);
    }
  }
  return { crown, trunk };
}
