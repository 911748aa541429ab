import { BoxGeometry } from "three";
import { describe, expect, it } from "vitest";
import { cornersOf, Ground } from "./ground.ts";
import { Obstacles } from "./obstacles.ts";
import { PlaneGeometry } from "three";

const BODY = 0.3;

describe("obstacles", () => {
  it("stop a walker that goes straight at a trunk", () => {
    const forest = new Obstacles();
    forest.addTrunk(5, 0, 0.4);
    let at: [number, number] = [0, 0];
    for (let i = 0; i < 200; i++) at = forest.walk(at, [at[0] + 0.1, at[1]], BODY, 0.5, 1.7);
    expect(at[0]).toBeLessThan(5 - 0.4 - BODY + 1e-3);
  });

  it("let him slide past on one side", () => {
    const forest = new Obstacles();
    forest.addTrunk(5, 0.1, 0.4);
    let at: [number, number] = [0, 0];
    for (let i = 0; i < 200; i++) at = forest.walk(at, [at[0] + 0.1, at[1]], BODY, 0.5, 1.7);
    expect(at[0]).toBeGreaterThan(6);
    expect(Math.hypot(at[0] - 5, at[1] - 0.1)).toBeGreaterThan(0.7 - 1e-3);
  });

  it("are not passed in one long step", () => {
    const forest = new Obstacles();
    forest.addTrunk(5, 0, 0.2);
    expect(forest.walk([0, 0], [10, 0], BODY, 0.5, 1.7)[0]).toBeLessThan(4.6);
  });

  it("have walls between knee and head, not above or below", () => {
    const walls = new Obstacles();
    const house = new BoxGeometry(4, 4, 6).translate(10, 0, 3);
    const bridge = new BoxGeometry(1, 40, 2).translate(5, 0, 6);
    const kerb = new BoxGeometry(0.2, 40, 0.2).translate(3, 0, 0.1);
    for (const shape of [house, bridge, kerb]) walls.addWalls(cornersOf([shape]));
    const [x] = walls.walk([0, 0], [20, 0], BODY, 0.5, 1.7);
    expect(x).toBeGreaterThan(7.5);
    expect(x).toBeLessThan(8 - BODY + 1e-3);
  });

  it("do not trap a walker that begins within one", () => {
    const forest = new Obstacles();
    forest.addTrunk(0, 0, 0.5);
    const [x, y] = forest.walk([0, 0], [0, 0], BODY, 0.5, 1.7);
    expect(Math.hypot(x, y)).toBeCloseTo(0.8, 3);
  });
});

describe("ground", () => {
  it("is as high as its triangles", () => {
    const slope = new PlaneGeometry(100, 100, 20, 20);
    const position = slope.getAttribute("position");
    for (let i = 0; i < position.count; i++) position.setZ(i, 0.1 * position.getX(i) + 3);
    const ground = new Ground([slope]);
    for (const [x, y] of [
      [0, 0],
      [12.3, -44],
      [-49.9, 49.9],
      [50, 50],
    ] as const)
      expect(ground.heightAt(x, y)).toBeCloseTo(0.1 * x + 3, 5);
    expect(ground.heightAt(500, 0)).toBeCloseTo(-2, 5);
  });

  it("of two large triangles is as good", () => {
    const ground = new Ground([new PlaneGeometry(1000, 1000).translate(0, 0, 5)]);
    expect(ground.heightAt(123, -321)).toBe(5);
    expect(new Ground([]).heightAt(1, 1)).toBe(0);
  });
});
