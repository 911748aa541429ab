import {
  BoxGeometry,
  CylinderGeometry,
  Group,
  InstancedMesh,
  Matrix4,
  Mesh,
  PlaneGeometry,
} from "three";
import { expect, it } from "vitest";
import { heightAt, planOf, planWorld } from "./worldPlan.ts";

/** Axes as in a glTF: y up, north is -z. */
function world(): Group {
  const ground = new Mesh(new PlaneGeometry(100, 60).rotateX(-Math.PI / 2));
  ground.name = "ground";
  ground.position.y = 1;
  const block = new Mesh(new BoxGeometry(4, 6, 2));
  block.name = "solids";
  block.position.set(10, 4, -20);
  const trees = new InstancedMesh(
    new CylinderGeometry(0.2, 0.3, 8).translate(0, 4, 0),
    undefined,
    1,
  );
  trees.setMatrixAt(0, new Matrix4().makeScale(2, 2, 2).setPosition(-7, 1, 5));
  return new Group().add(ground, block, trees);
}

it("a world is seen from above in the map's axes", () => {
  const { ground, trees, roofs } = planOf(world());
  expect(ground).toMatchObject({ x: -50, y: -30 });
  expect(trees).toHaveLength(1);
  expect(trees[0]).toMatchObject({ x: -7, y: -5, crown: expect.closeTo(0.6) });
  // The top of the block, two triangles, at x 8..12, y 19..21, z 7.
  expect(roofs).toHaveLength(18);
  for (let i = 0; i < 18; i += 3) {
    expect(Math.abs(roofs[i]! - 10)).toBeCloseTo(2);
    expect(Math.abs(roofs[i + 1]! - 20)).toBeCloseTo(1);
    expect(roofs[i + 2]).toBeCloseTo(7);
  }
});

it("tells heights of the ground", () => {
  planWorld(world());
  expect(heightAt(10, 20)).toBeCloseTo(1);
  expect(heightAt(1000, 0)).toBe(0);
  planWorld(null);
  expect(heightAt(10, 20)).toBe(0);
});
