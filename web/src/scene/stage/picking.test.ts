import { PerspectiveCamera } from "three";
import { beforeEach, expect, it, vi } from "vitest";

vi.mock("../../link/link.ts", () => ({ link: { frames: {}, subscribe: () => 0, watch: () => 0 } }));

const { fleet } = await import("../uavs/fleet.ts");
const { pickUav, uavsWithin } = await import("./picking.ts");
const { shown } = await import("./shown.ts");

const SIZE = { width: 200, height: 100 };
const camera = new PerspectiveCamera(90, 2, 0.1, 100);

/** Looks along x from the origin: at 10 m a pixel is 0.2 m wide. */
beforeEach(() => {
  camera.up.set(0, 0, 1);
  camera.lookAt(1, 0, 0);
  camera.updateMatrixWorld();
  const uav = { airframe: "", mode: "", crashed: false, airborne: true, rotorSpeed: 0 };
  const colour: [number, number, number] = [1, 1, 1];
  const positions = [
    [10, 0, 0],
    [10, 8, 4],
    [10, -8, -4],
    [-10, 8, 4],
  ];
  fleet.uavs = [...positions, [NaN, NaN, NaN]].map((_, i) => ({
    ...uav,
    colour,
    name: `uav${i + 1}`,
    row: i,
  }));
  fleet.uavs.push({ ...uav, colour, name: "untold", row: -1 });
  shown.poses = Float64Array.from(
    [...positions, [NaN, NaN, NaN]].flatMap((p) => [...p, 0, 0, 0, 1]),
  );
});

it("a box selects what is seen in it, from whichever corner it is drawn", () => {
  const within = (ax: number, ay: number, bx: number, by: number) =>
    uavsWithin({ x: ax, y: ay }, { x: bx, y: by }, camera, SIZE);
  expect(within(0, 0, 200, 100)).toEqual(["uav1", "uav2", "uav3"]); // none behind the camera
  expect(within(0, 0, 110, 60)).toEqual(["uav1", "uav2"]);
  expect(within(110, 60, 0, 0)).toEqual(["uav1", "uav2"]);
  expect(within(0, 0, 200, 60)).toEqual(["uav1", "uav2"]);
  expect(within(0, 45, 200, 100)).toEqual(["uav1", "uav3"]);
  expect(within(62, 32, 138, 68)).toEqual(["uav1"]);
  expect(within(0, 0, 20, 20)).toEqual([]);
});

it("a click picks the UAV below it", () => {
  expect(pickUav(60, 30, camera, SIZE)).toBe("uav2");
  expect(pickUav(5, 95, camera, SIZE)).toBe("");
});
