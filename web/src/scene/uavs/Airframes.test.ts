import { PerspectiveCamera, Points, type InstancedMesh } from "three";
import { beforeEach, expect, it, vi } from "vitest";

const row = (name: string) => Number(/\d+/.exec(name)![0]) - 1;
vi.mock("../../link/link.ts", () => ({
  link: { frames: { version: 1, row }, subscribe: () => 0 },
}));

const { colourBy } = await import("../../state/colouring.ts");
const { useVehicles } = await import("../../state/vehicles.ts");
const { shown } = await import("../stage/shown.ts");
const { Airframes } = await import("./Airframes.ts");
const { fleet } = await import("./fleet.ts");
type Moment = Parameters<InstanceType<typeof Airframes>["update"]>[0];
type Vehicle = ReturnType<typeof useVehicles.getState>["list"][number];

const camera = new PerspectiveCamera(55, 1, 0.1, 6000);
const renderer = { getPixelRatio: () => 1 };
const moment = { stepS: 0.1, camera, height: 500, renderer } as unknown as Moment;
/** Of an F450, whose radius is 0.34 m, at 480 px a metre: near, small, and two that are far. */
const AWAY_M = [5, 50, 200, 300];

beforeEach(() => {
  const still = { x: 0, y: 0, z: 0 };
  const list = AWAY_M.map((away, i) => ({
    ...{ name: `uav${i + 1}`, airframe: "f450", type: "", battery: NaN, velocity: still },
    ...{ rotor_speed: 0.5, position: { x: away, y: 0, z: 2 * i } },
  }));
  useVehicles.setState({ list: list as unknown as Vehicle[] });
  shown.poses = Float64Array.from(AWAY_M.flatMap((away) => [away, 0, 0, 0, 0, 0, 1]));
  colourBy("uav");
  fleet.update();
});

/** How many bodies, rotors with blades, blurred rotors and dots are drawn. */
function drawn(airframes: InstanceType<typeof Airframes>): number[] {
  airframes.update(moment);
  return airframes.object.children.map((child) => {
    if (!child.visible) return 0;
    return child instanceof Points
      ? child.geometry.drawRange.count
      : (child as InstancedMesh).count;
  });
}

it("small UAVs have no rotors, and smaller ones are dots", () => {
  const airframes = new Airframes();
  expect(drawn(airframes)).toEqual([2, 4, 4, 2]);
  shown.poses[0] = NaN; // not known
  expect(drawn(airframes)).toEqual([1, 0, 0, 2]);
});

it("bodies have the colour that stands for something, and their own ones again", () => {
  const airframes = new Airframes();
  const body = () => airframes.object.children[0] as InstancedMesh;
  const vertexColours = () =>
    (body().material as unknown as { vertexColors: boolean }).vertexColors;
  drawn(airframes);
  expect([vertexColours(), body().instanceColor!.getX(0)]).toEqual([true, 1]);
  colourBy("height");
  fleet.update();
  drawn(airframes);
  expect(vertexColours()).toBe(false);
  const colours = [0, 1].map((i) => [0, 1, 2].map((k) => body().instanceColor!.getComponent(i, k)));
  expect(colours[0]).toEqual(fleet.uavs[0]!.colour.map((value) => Math.fround(value)));
  expect(colours[1]).toEqual(fleet.uavs[1]!.colour.map((value) => Math.fround(value)));
  expect(colours[0]).not.toEqual(colours[1]);
  const dots = airframes.object.children[3] as Points;
  expect(dots.geometry.getAttribute("tint").getX(1)).toBe(Math.fround(fleet.uavs[3]!.colour[0]));
  colourBy("uav");
  fleet.update();
  drawn(airframes);
  expect([vertexColours(), body().instanceColor!.getX(1)]).toEqual([true, 1]);
});
