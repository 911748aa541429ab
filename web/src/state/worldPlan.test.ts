import { BoxGeometry, CylinderGeometry, Matrix4, PlaneGeometry } from "three";
import { expect, it } from "vitest";
import { heightAt, planOf, planWorld, type PlanSource } from "./worldPlan.ts";

function world(): PlanSource {
  const trunk = new CylinderGeometry(0.2, 0.3, 8).rotateX(Math.PI / 2).translate(0, 0, 4);
  return {
    solids: [
      {
        geometry: new PlaneGeometry(100, 60),
        material: "ground",
        transform: new Matrix4().setPosition(0, 0, 1),
      },
      {
        geometry: new BoxGeometry(4, 2, 6),
        material: "concrete",
        transform: new Matrix4().setPosition(10, 20, 4),
      },
    ],
    models: [
      {
        parts: [{ geometry: trunk }],
        transforms: new Float32Array(
          new Matrix4().makeScale(2, 2, 2).setPosition(-7, -5, 1).elements,
        ),
      },
    ],
  };
}

it("a world is seen from above", () => {
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

it("has the heights of the ground", () => {
  planWorld(world());
  expect(heightAt(10, 20)).toBeCloseTo(1);
  expect(heightAt(1000, 0)).toBe(0);
  planWorld(null);
  expect(heightAt(10, 20)).toBe(0);
});
