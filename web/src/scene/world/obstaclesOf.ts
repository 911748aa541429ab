import { Matrix4, Vector3 } from "three";
import { cornersOf } from "./ground.ts";
import { Obstacles } from "./obstacles.ts";
import type { Model, WorldContent } from "./readWorld.ts";

/** A walker meets what a trunk is from the foot to here, m. */
const BREAST_M = 1.6;
const SLIMMEST_M = 0.05;

/** Trunks of the trees and walls of everything else but the ground. */
export function obstaclesOf(
  { solids, models }: WorldContent,
  isGround: (name: string) => boolean,
): Obstacles {
  const obstacles = new Obstacles();
  for (const model of models) addTrunks(obstacles, model);
  for (const { geometry, transform, material } of solids) {
    if (isGround(material)) continue;
    obstacles.addWalls(cornersOf([geometry.clone().applyMatrix4(transform)]));
  }
  return obstacles;
}

function addTrunks(obstacles: Obstacles, { parts, transforms }: Model): void {
  const wood = parts.filter(({ material }) => material === "wood");
  const solid = wood.length > 0 ? wood : parts.filter(({ material }) => material !== "leaf");
  if (solid.length === 0) return;
  const corners = cornersOf(solid.map(({ geometry }) => geometry));
  if (wood.length === 0) {
    addCopies(obstacles, corners, transforms);
    return;
  }
  const { x, y, radius } = footOf(corners);
  const foot = new Vector3();
  const transform = new Matrix4();
  for (let at = 0; at < transforms.length; at += 16) {
    transform.fromArray(transforms, at);
    foot.set(x, y, 0).applyMatrix4(transform);
    const scale = Math.hypot(transforms[at]!, transforms[at + 1]!, transforms[at + 2]!);
    obstacles.addTrunk(foot.x, foot.y, Math.max(SLIMMEST_M, radius * scale));
  }
}

/** Walls of a shape that is no tree, wherever it stands. */
function addCopies(obstacles: Obstacles, corners: Float64Array, transforms: Float32Array): void {
  const point = new Vector3();
  const transform = new Matrix4();
  const moved = new Float64Array(corners.length);
  for (let at = 0; at < transforms.length; at += 16) {
    transform.fromArray(transforms, at);
    for (let i = 0; i < corners.length; i += 3) {
      point.fromArray(corners, i).applyMatrix4(transform);
      point.toArray(moved, i);
    }
    obstacles.addWalls(moved);
  }
}

/** Middle and radius of a trunk, in the plan, from its corners below breast height. */
function footOf(corners: Float64Array): { x: number; y: number; radius: number } {
  let [left, right, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let i = 0; i < corners.length; i += 3) {
    if (corners[i + 2]! > BREAST_M) continue;
    left = Math.min(left, corners[i]!);
    right = Math.max(right, corners[i]!);
    south = Math.min(south, corners[i + 1]!);
    north = Math.max(north, corners[i + 1]!);
  }
  if (left > right) return { x: 0, y: 0, radius: SLIMMEST_M };
  return {
    x: 0.5 * (left + right),
    y: 0.5 * (south + north),
    radius: 0.25 * (right - left + north - south),
  };
}
