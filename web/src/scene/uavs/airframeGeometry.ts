import {
  BoxGeometry,
  BufferAttribute,
  Color,
  CylinderGeometry,
  Euler,
  Matrix4,
  Quaternion,
  Vector3,
  type BufferGeometry,
} from "three";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";
import {
  AIRFRAMES,
  USUAL_COLOURS,
  type AirframeColours,
  type AirframeShape,
} from "./airframes.generated.ts";
import { ownEntry } from "../../lib/ownEntry.ts";

/** Shape of an airframe by name; of one that is not known an ordinary quadrotor's. */
export function shapeOf(airframe: string): AirframeShape {
  return ownEntry(AIRFRAMES, airframe) ?? AIRFRAMES.f450!;
}

const radii = new Map<string, number>();

/** From the middle of an airframe to the tips of its outermost rotor, m. */
export function radiusOf(airframe: string): number {
  let radius = radii.get(airframe);
  if (radius === undefined) {
    const { rotors, rotorRadius } = shapeOf(airframe);
    radius = rotorRadius + Math.max(...rotors.map(([x, y]) => Math.hypot(x!, y!)));
    radii.set(airframe, radius);
  }
  return radius;
}

/**
 * Body, arms, motors and feet in one geometry with colours in its vertices; cameras and LIDARs
 * see the same one (src/volery/vehicle/body_shape.py).
 */
export function bodyOf(airframe: string): BufferGeometry {
  const shape = shapeOf(airframe);
  const colours = ownEntry(AIRFRAMES, airframe)?.colours ?? USUAL_COLOURS;
  const pieces = [
    ...hub(shape, colours),
    ...shape.rotors.flatMap((rotor) => arm(shape, rotor, colours)),
    ...shape.feet.flatMap((foot) => leg(shape, foot, colours)),
  ];
  const body = mergeGeometries(pieces);
  for (const piece of pieces) piece.dispose();
  return body;
}

/** Two plates, electronics between them, the battery on top, a mark in front. */
function hub({ size }: AirframeShape, { plates, front }: AirframeColours): BufferGeometry[] {
  const [x, y, z] = size;
  const thick = 0.06 * Math.min(x, y, z);
  return [
    box([x, y * 0.8, thick * 1.5], [0, 0, 0.22 * z], plates),
    box([x * 0.9, y * 0.72, thick * 1.5], [0, 0, -0.18 * z], plates),
    box([x * 0.55, y * 0.45, 0.32 * z], [0, 0, 0.02 * z], "#4a4f57"),
    box([x * 0.62, y * 0.3, 0.22 * z], [-0.04 * x, 0, 0.35 * z], "#1d4f91"),
    box([x * 0.08, y * 0.3, 0.12 * z], [0.5 * x, 0, 0.02 * z], front),
  ];
}

function arm(
  { size, rotorRadius }: AirframeShape,
  rotor: readonly number[],
  colours: AirframeColours,
) {
  const [x, y, z] = rotor as [number, number, number];
  const length = Math.hypot(x, y);
  const thick = Math.max(0.012 * length, 0.1 * length);
  const motorZ = z - 0.16 * rotorRadius;
  const from = new Vector3(0.12 * x, 0.12 * y, Math.min(motorZ, 0.18 * size[2]));
  const to = new Vector3(x, y, motorZ);
  return [
    bar(from, to, thick, 0.6 * thick, x > 0.01 * length ? colours.front : colours.back),
    cylinder(0.13 * rotorRadius, 0.22 * rotorRadius, [x, y, z - 0.12 * rotorRadius], "#3d4045"),
    cylinder(0.05 * rotorRadius, 0.1 * rotorRadius, [x, y, z + 0.02 * rotorRadius], "#b9bcc2"),
  ];
}

function leg({ size, rotors }: AirframeShape, foot: readonly number[], { legs }: AirframeColours) {
  const [x, y, z] = foot as [number, number, number];
  const radius = Math.max(...rotors.map(([rx, ry]) => Math.hypot(rx!, ry!)));
  const thick = 0.045 * radius;
  const top = new Vector3(0.7 * x, 0.7 * y, -0.1 * size[2]);
  return [
    bar(top, new Vector3(x, y, z + 0.5 * thick), thick, thick, legs),
    cylinder(1.1 * thick, 0.5 * thick, [x, y, z + 0.25 * thick], legs),
  ];
}

/** Two blades as wide as they are on such rotors, twisted; radius 1, turning about z. */
export function bladesOf(): BufferGeometry {
  const blades = [1, -1].map((side) => {
    const blade = new BoxGeometry(0.92, 0.16, 0.02, 3, 1, 1);
    blade.translate(0.52, 0, 0);
    const position = blade.getAttribute("position");
    for (let i = 0; i < position.count; i++) {
      const x = position.getX(i);
      const chord = 1.15 - 0.75 * x;
      position.setY(i, position.getY(i) * chord);
      position.setZ(i, position.getZ(i) + position.getY(i) * 0.35 * (1 - 0.6 * x));
    }
    if (side < 0) blade.rotateZ(Math.PI);
    return painted(blade, "#101114");
  });
  const both = mergeGeometries(blades);
  both.computeVertexNormals();
  return both;
}

/** A spinning scanner on its foot. */
export function lidarBody(): BufferGeometry {
  return mergeGeometries([
    cylinder(0.03, 0.03, [0, 0, -0.02], "#202226"),
    cylinder(0.026, 0.028, [0, 0, 0.01], "#0b0c0e"),
    cylinder(0.03, 0.012, [0, 0, 0.03], "#c77a1c"),
  ]);
}

/** A small camera that looks along x. */
export function cameraBody(): BufferGeometry {
  const lens = cylinder(0.009, 0.014, [0, 0, 0], "#05060a");
  lens.rotateY(Math.PI / 2).translate(0.013, 0, 0);
  return mergeGeometries([box([0.02, 0.036, 0.026], [0, 0, 0], "#2f3338"), lens]);
}

type Triple = [number, number, number];

export function box(sides: Triple, at: Triple, colour: string): BufferGeometry {
  return painted(new BoxGeometry(...sides).translate(...at), colour);
}

export function cylinder(
  radius: number,
  height: number,
  at: Triple,
  colour: string,
): BufferGeometry {
  const upright = new CylinderGeometry(radius, radius, height, 14).rotateX(Math.PI / 2);
  return painted(upright.translate(...at), colour);
}

/** A straight piece between two points. */
export function bar(
  from: Vector3,
  to: Vector3,
  wide: number,
  high: number,
  colour: string,
): BufferGeometry {
  const along = to.clone().sub(from);
  const piece = new BoxGeometry(along.length(), wide, high);
  const yaw = Math.atan2(along.y, along.x);
  const pitch = -Math.atan2(along.z, Math.hypot(along.x, along.y));
  const turn = new Quaternion().setFromEuler(new Euler(0, pitch, yaw, "ZYX"));
  const middle = from.clone().add(to).multiplyScalar(0.5);
  piece.applyMatrix4(new Matrix4().compose(middle, turn, new Vector3(1, 1, 1)));
  return painted(piece, colour);
}

export function painted(geometry: BufferGeometry, colour: string): BufferGeometry {
  const { r, g, b } = new Color(colour);
  const count = geometry.getAttribute("position").count;
  const colours = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) colours.set([r, g, b], 3 * i);
  geometry.deleteAttribute("uv");
  return geometry.setAttribute("color", new BufferAttribute(colours, 3));
}
