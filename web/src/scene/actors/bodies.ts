// Bodies of actors, after `volery.world.actors.shapes`: the origin of people and cars is on the
// ground below their middle, that of a bird in its middle; x is forward. Metres.

import { BufferGeometry, SphereGeometry } from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";
import { bar, box, cylinder, painted } from "../uavs/airframeGeometry.ts";
import { Vector3 } from "three";
import type { ActorKind } from "./kinds.ts";
import { blackPlates, boardSide, type TagPrint } from "./tagPrint.ts";

const CLOTHES = "#2f4f8f";
const TROUSERS = "#2a2d36";
const SKIN = "#c99a78";
const PAINT = "#1f4e8c";
const GLASS = "#10141a";
const TYRE = "#0b0b0c";

export function bodyOfActor(kind: ActorKind, print: TagPrint | null = null): BufferGeometry {
  return mergeGeometries(print === null ? PIECES[kind]() : printed(print));
}

/** A tag: a white board with black cells; shades are those of the cameras' materials. */
function printed(print: TagPrint): BufferGeometry[] {
  const side = boardSide(print);
  return [
    box([side, side, 0.003], [0, 0, 0.0015], "#c4c4c4"),
    ...blackPlates(print).map(({ x, y, along, across }) =>
      box([along, across, 0.002], [x, y, 0.004], "#303030"),
    ),
  ];
}

const PIECES: Record<ActorKind, () => BufferGeometry[]> = {
  person: () => [
    limb(0.06, 0.1, 0.85, -0.06, 0.1, 0.05, 0.13, TROUSERS),
    limb(-0.02, -0.1, 0.85, 0.1, -0.1, 0.05, 0.13, TROUSERS),
    box([0.24, 0.4, 0.6], [0, 0, 1.15], CLOTHES),
    limb(0, 0.26, 1.4, -0.1, 0.28, 0.85, 0.1, CLOTHES),
    limb(0, -0.26, 1.4, 0.1, -0.28, 0.85, 0.1, CLOTHES),
    ball(0.11, [0, 0, 1.62], [0.95, 0.8, 1.25], SKIN),
    ball(0.115, [-0.015, 0, 1.68], [0.98, 0.85, 0.95], "#3a2a1c"),
  ],
  car: () => [
    box([4.4, 1.8, 0.45], [0, 0, 0.62], PAINT),
    box([4.2, 1.7, 0.2], [0, 0, 0.33], "#1a1c20"),
    box([2.4, 1.55, 0.5], [-0.35, 0, 1.1], GLASS),
    box([1.9, 1.5, 0.08], [-0.4, 0, 1.39], PAINT),
    box([0.06, 1.5, 0.14], [2.2, 0, 0.68], "#f4f2e0"),
    box([0.06, 1.5, 0.12], [-2.2, 0, 0.7], "#9c1712"),
    ...[1.35, -1.35].flatMap((x) =>
      [0.8, -0.8].map((y) =>
        cylinder(0.32, 0.22, [0, 0, 0], TYRE)
          .rotateX(Math.PI / 2)
          .translate(x, y, 0.32),
      ),
    ),
  ],
  bird: () => [
    ball(0.1, [0, 0, 0], [2.3, 0.75, 0.75], "#e9eaec"),
    ball(0.05, [0.26, 0, 0.04], [1.2, 0.9, 0.9], "#f6f6f6"),
    bar(new Vector3(0.3, 0, 0.03), new Vector3(0.37, 0, 0.02), 0.02, 0.02, "#d99a1e"),
    wing(1),
    wing(-1),
    box([0.16, 0.14, 0.015], [-0.3, 0, 0.01], "#c9ccd0"),
  ],
  tag: () => [box([0.6, 0.6, 0.005], [0, 0, 0.0025], "#c4c4c4")],
  thing: () => [box([0.5, 0.5, 0.5], [0, 0, 0.25], "#c58a2c")],
};

function limb(
  ax: number,
  ay: number,
  az: number,
  bx: number,
  by: number,
  bz: number,
  thick: number,
  colour: string,
): BufferGeometry {
  return bar(new Vector3(ax, ay, az), new Vector3(bx, by, bz), thick, thick, colour);
}

function wing(side: 1 | -1): BufferGeometry {
  const piece = bar(
    new Vector3(0, 0.06 * side, 0.02),
    new Vector3(-0.03, 0.65 * side, 0.14),
    0.2,
    0.015,
    "#9ea4ab",
  );
  return piece;
}

function ball(
  radius: number,
  at: [number, number, number],
  stretch: [number, number, number],
  colour: string,
): BufferGeometry {
  const sphere = new SphereGeometry(radius, 14, 10).scale(...stretch).translate(...at);
  return painted(sphere, colour);
}
