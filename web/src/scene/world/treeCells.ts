import { Sphere, Vector3, type Frustum } from "three";
import type { Model } from "./readWorld.ts";

const CELL_M = 32;
/** Trees as close as this are kept beside the view too: their shadows fall into it, m. */
const BEHIND_M = 30;
/** The view may turn so far before trees are chosen again, rad. */
export const TURN_RAD = 0.07;

interface Cell {
  sphere: Sphere;
  /** Model and number of each tree. */
  trees: [model: number, tree: number][];
}

/** Chosen trees of one model. */
export interface Chosen {
  whole: number[];
  distant: number[];
}

/** Which trees are seen from somewhere, and which of them closely: by the cells of a grid. */
export class TreeCells {
  private readonly cells: Cell[];

  constructor(
    private readonly models: readonly Model[],
    tallest: number,
  ) {
    const cells = new Map<string, Cell>();
    models.forEach(({ transforms }, model) => {
      for (let tree = 0; 16 * tree < transforms.length; tree++) {
        const [x, y, z] = positionOf(transforms, tree);
        const key = `${Math.floor(x / CELL_M)} ${Math.floor(y / CELL_M)}`;
        const cell = cells.get(key) ?? { sphere: new Sphere(), trees: [] };
        cells.set(key, cell);
        cell.trees.push([model, tree]);
        cell.sphere.center.add(new Vector3(x, y, z));
      }
    });
    for (const { sphere, trees } of cells.values()) {
      sphere.center.divideScalar(trees.length);
      for (const [model, tree] of trees) {
        const [x, y, z] = positionOf(models[model]!.transforms, tree);
        const distance = sphere.center.distanceTo(new Vector3(x, y, z));
        sphere.radius = Math.max(sphere.radius, distance + tallest);
      }
    }
    this.cells = [...cells.values()];
  }

  /** Sort what is in view by distance into `out`, one entry a model. */
  choose(eye: Vector3, frustum: Frustum, wholeM: number, out: Chosen[]): void {
    for (const { whole, distant } of out) whole.length = distant.length = 0;
    const wide = new Sphere();
    for (const { sphere, trees } of this.cells) {
      const away = sphere.center.distanceTo(eye);
      wide.copy(sphere);
      wide.radius += away * TURN_RAD;
      const close = away - sphere.radius < BEHIND_M;
      if (!close && !frustum.intersectsSphere(wide)) continue;
      for (const [model, tree] of trees) {
        const [x, y, z] = positionOf(this.models[model]!.transforms, tree);
        const square = (x - eye.x) ** 2 + (y - eye.y) ** 2 + (z - eye.z) ** 2;
        const { whole, distant } = out[model]!;
        (square < wholeM * wholeM ? whole : distant).push(tree);
      }
    }
  }
}

export function positionOf(transforms: Float32Array, tree: number): [number, number, number] {
  const at = 16 * tree + 12;
  return [transforms[at]!, transforms[at + 1]!, transforms[at + 2]!];
}
