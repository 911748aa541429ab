import { Frustum, Matrix4, PerspectiveCamera, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import type { Model } from "./readWorld.ts";
import { positionOf, TreeCells, type Chosen } from "./treeCells.ts";

/** 5,000 trees on a lattice of 7 m. */
function forest(): Model {
  const transforms = new Float32Array(16 * 5000);
  for (let i = 0; i < 5000; i++)
    new Matrix4()
      .makeTranslation(7 * (i % 71), 7 * Math.floor(i / 71), 0)
      .toArray(transforms, 16 * i);
  return { parts: [], transforms };
}

function choose(position: [number, number, number], towards: [number, number, number]) {
  const camera = new PerspectiveCamera(55, 16 / 9, 0.05, 4000);
  camera.up.set(0, 0, 1);
  camera.position.set(...position);
  camera.lookAt(...towards);
  camera.updateMatrixWorld();
  const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  const frustum = new Frustum().setFromProjectionMatrix(matrix);
  const model = forest();
  const out: Chosen[] = [{ whole: [], distant: [] }];
  new TreeCells([model], 20).choose(camera.position, frustum, 40, out);
  return { model, camera, frustum, chosen: out[0]! };
}

describe("trees that are drawn", () => {
  it("are whole near the camera and impostors beyond", () => {
    const { model, camera, chosen } = choose([250, 250, 3], [400, 250, 3]);
    const away = (tree: number) =>
      new Vector3(...positionOf(model.transforms, tree)).distanceTo(camera.position);
    expect(chosen.whole.length).toBeGreaterThan(0);
    for (const tree of chosen.whole) expect(away(tree)).toBeLessThan(40);
    for (const tree of chosen.distant) expect(away(tree)).toBeGreaterThanOrEqual(40);
  });

  it("are all that are in view, and far from all that there are", () => {
    const { model, frustum, chosen } = choose([250, 250, 3], [400, 250, 3]);
    const drawn = new Set([...chosen.whole, ...chosen.distant]);
    for (let tree = 0; tree < 5000; tree++)
      if (frustum.containsPoint(new Vector3(...positionOf(model.transforms, tree))))
        expect(drawn.has(tree)).toBe(true);
    expect(drawn.size).toBeLessThan(3000);
  });
});
