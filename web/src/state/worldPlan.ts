// The world from above, for the map and for clicks on the ground: made once when a world is shown.

import { InstancedMesh, Matrix4, Mesh, Vector3, type BufferGeometry, type Object3D } from "three";
import { create } from "zustand";
import { heightIn, heightsOf, type Heights, type Triangles } from "../lib/heights.ts";

export interface Tree {
  x: number;
  y: number;
  /** Radius of what is drawn, m. */
  crown: number;
  /** Radius of the trunk, m; 0: these are leaves. */
  trunk: number;
}

export interface WorldPlan {
  ground: Heights | null;
  trees: Tree[];
  /** Surfaces of buildings and blocks that face upwards. */
  roofs: Triangles;
}

const MOST_CELLS = 384;
/** Below this height a tree is its trunk, m. */
const TRUNK_TOP_M = 1.5;
/** Least share of a normal that points up for a roof. */
const UPWARD = 0.2;

export const useWorldPlan = create<{ plan: WorldPlan | null }>(() => ({ plan: null }));

/** Take a world that was loaded (axes of glTF, y up), before anything moves its parts; null: none. */
export function planWorld(world: Object3D | null): void {
  useWorldPlan.setState({ plan: world === null ? null : planOf(world) });
}

export function planOf(world: Object3D): WorldPlan {
  world.updateMatrixWorld(true);
  const ground: number[] = [];
  const roofs: number[] = [];
  const trees: Tree[] = [];
  world.traverse((object) => {
    if (object instanceof InstancedMesh) addTrees(object, trees);
    else if (object instanceof Mesh && isGround(object)) addTriangles(object, ground, -1);
    else if (object instanceof Mesh) addTriangles(object, roofs, UPWARD);
  });
  return {
    ground: heightsOf(new Float32Array(ground), MOST_CELLS),
    trees,
    roofs: new Float32Array(roofs),
  };
}

/** Height of the ground, m; 0 where there is none. */
export function heightAt(x: number, y: number): number {
  const ground = useWorldPlan.getState().plan?.ground ?? null;
  const height = ground === null ? 0 : heightIn(ground, x, y);
  return Number.isNaN(height) ? 0 : height;
}

/** Of several materials a ground is a group of that name. */
function isGround(object: Object3D): boolean {
  return /^ground/.test(object.name) || /^ground/.test(object.parent?.name ?? "");
}

/** Triangles of a mesh in the map whose normals point up at least so much. */
function addTriangles(mesh: Mesh, into: number[], upward: number): void {
  const geometry = mesh.geometry as BufferGeometry;
  const position = geometry.getAttribute("position");
  const index = geometry.getIndex();
  const count = index?.count ?? position.count;
  const corners = [new Vector3(), new Vector3(), new Vector3()] as const;
  const [one, other] = [new Vector3(), new Vector3()];
  for (let i = 0; i + 3 <= count; i += 3) {
    corners.forEach((corner, k) => {
      corner.fromBufferAttribute(position, index?.getX(i + k) ?? i + k);
      corner.applyMatrix4(mesh.matrixWorld);
    });
    const [a, b, c] = corners;
    const normal = one.subVectors(b, a).cross(other.subVectors(c, a));
    if (normal.y < upward * normal.length()) continue;
    for (const { x, y, z } of corners) into.push(x, -z, y);
  }
}

function addTrees(mesh: InstancedMesh, into: Tree[]): void {
  const { crown, trunk } = radiiOf(mesh.geometry as BufferGeometry);
  const matrix = new Matrix4();
  for (let i = 0; i < mesh.count; i++) {
    mesh.getMatrixAt(i, matrix);
    matrix.premultiply(mesh.matrixWorld);
    const scale = matrix.getMaxScaleOnAxis();
    const { elements } = matrix;
    const [x, y] = [elements[12]!, -elements[14]!];
    into.push({ x, y, crown: crown * scale, trunk: trunk * scale });
  }
}

function radiiOf(geometry: BufferGeometry): { crown: number; trunk: number } {
  const position = geometry.getAttribute("position");
  let [crown, trunk] = [0, 0];
  for (let i = 0; i < position.count; i++) {
    const radius = Math.hypot(position.getX(i), position.getZ(i));
    crown = Math.max(crown, radius);
    if (position.getY(i) < TRUNK_TOP_M) trunk = Math.max(trunk, radius);
  }
  return { crown, trunk };
}
