// What a marker is made of, in the map: lines, boxes, balls and so on, all as plain numbers.

import type { geometry_msgs_Point, visualization_msgs_Marker } from "../../messages/generated.ts";
import { compose, type Pose } from "../../lib/pose.ts";
import { toMap } from "../stage/mapFrame.ts";

export type Rgba = readonly [number, number, number, number];
export type Shape = "cube" | "sphere" | "cylinder" | "cone";

export interface Pieces {
  shapes: { shape: Shape; pose: Pose; scale: [number, number, number]; colour: Rgba }[];
  lines: {
    from: [number, number, number];
    to: [number, number, number];
    width: number;
    colour: Rgba;
  }[];
  triangles: { corners: [number, number, number][]; colours: Rgba[] }[];
  texts: { at: [number, number, number]; text: string; height: number; colour: Rgba }[];
}

const [ARROW, CUBE, SPHERE, CYLINDER, LINE_STRIP, LINE_LIST] = [0, 1, 2, 3, 4, 5];
const [CUBE_LIST, SPHERE_LIST, POINTS, TEXT, TRIANGLES, ARROW_STRIP] = [6, 7, 8, 9, 11, 12];
const SHAPES: Readonly<Record<number, Shape>> = {
  [CUBE!]: "cube",
  [SPHERE!]: "sphere",
  [CYLINDER!]: "cylinder",
  [CUBE_LIST!]: "cube",
  [SPHERE_LIST!]: "sphere",
  [POINTS!]: "cube",
};
const HEAD_SHARE = 0.23;
/** What arrows with points leave out, m. */
const SHAFT_M = 0.05;

export function emptyPieces(): Pieces {
  return { shapes: [], lines: [], triangles: [], texts: [] };
}

/** Add the pieces of a marker; `frame`: pose of its frame in the map. */
export function addPieces(
  marker: visualization_msgs_Marker,
  frame: Readonly<Pose>,
  out: Pieces,
): void {
  const pose = compose(frame, poseOf(marker));
  if (!pose.every(Number.isFinite)) return;
  const { type, scale, points } = marker;
  const at = (point: geometry_msgs_Point) => toMap(pose, point.x, point.y, point.z);
  const colour = (i: number) => colourOf(marker, i);
  switch (type) {
    case CUBE:
    case SPHERE:
    case CYLINDER:
      out.shapes.push({
        shape: SHAPES[type]!,
        pose,
        scale: [scale.x, scale.y, scale.z],
        colour: colour(-1),
      });
      break;
    case CUBE_LIST:
    case SPHERE_LIST:
    case POINTS: {
      const size: [number, number, number] =
        type === POINTS ? [scale.x, scale.y || scale.x, scale.x] : [scale.x, scale.y, scale.z];
      const turn = pose.slice(3) as [number, number, number, number];
      points.forEach((point, i) => {
        out.shapes.push({
          shape: SHAPES[type]!,
          pose: [...at(point), ...turn],
          scale: size,
          colour: colour(i),
        });
      });
      break;
    }
    case LINE_STRIP:
    case LINE_LIST: {
      const step = type === LINE_STRIP ? 1 : 2;
      for (let i = 0; i + 1 < points.length; i += step)
        out.lines.push({
          from: at(points[i]!),
          to: at(points[i + 1]!),
          width: scale.x,
          colour: colour(i),
        });
      break;
    }
    case ARROW:
      addArrow(marker, pose, out);
      break;
    case ARROW_STRIP:
      for (let i = 0; i + 1 < points.length; i++)
        arrow(at(points[i]!), at(points[i + 1]!), scale.x, scale.y, scale.z, colour(i), out);
      break;
    case TEXT: {
      const [x, y, z] = pose;
      out.texts.push({ at: [x, y, z], text: marker.text, height: scale.z, colour: colour(-1) });
      break;
    }
    case TRIANGLES:
      for (let i = 0; i + 2 < points.length; i += 3)
        out.triangles.push({
          corners: [0, 1, 2].map((k) => at(points[i + k]!)),
          colours: [0, 1, 2].map((k) =>
            colour(marker.colors.length >= points.length ? i + k : i / 3),
          ),
        });
      break;
  }
}

/** From its pose along x, or from its first point to its second. */
function addArrow(marker: visualization_msgs_Marker, pose: Pose, out: Pieces): void {
  const { points, scale } = marker;
  const colour = colourOf(marker, -1);
  if (points.length >= 2) {
    const [a, b] = [points[0]!, points[1]!];
    const [from, to] = [toMap(pose, a.x, a.y, a.z), toMap(pose, b.x, b.y, b.z)];
    arrow(from, to, scale.x, scale.y, scale.z, colour, out);
    return;
  }
  const to = toMap(pose, scale.x, 0, 0);
  arrow([pose[0], pose[1], pose[2]], to, scale.y, 2 * scale.y, HEAD_SHARE * scale.x, colour, out);
}

function arrow(
  from: [number, number, number],
  to: [number, number, number],
  shaft: number,
  head: number,
  headLength: number,
  colour: Rgba,
  out: Pieces,
): void {
  const delta = [0, 1, 2].map((i) => to[i]! - from[i]!) as [number, number, number];
  const length = Math.hypot(...delta);
  if (!(length > 1e-6)) return;
  const long = headLength > 0 ? Math.min(headLength, length) : HEAD_SHARE * length;
  const thick = shaft > 0 ? shaft : SHAFT_M;
  const wide = head > 0 ? head : 2 * thick;
  const turn = fromUp(delta[0] / length, delta[1] / length, delta[2] / length);
  const along = (share: number) =>
    [0, 1, 2].map((i) => from[i]! + share * delta[i]!) as [number, number, number];
  const shaftShare = (length - long) / length;
  out.shapes.push({
    shape: "cylinder",
    pose: [...along(0.5 * shaftShare), ...turn],
    scale: [thick, thick, length - long],
    colour,
  });
  out.shapes.push({
    shape: "cone",
    pose: [...along(0.5 * (1 + shaftShare)), ...turn],
    scale: [wide, wide, long],
    colour,
  });
}

/** Quaternion that turns z into a direction. */
function fromUp(x: number, y: number, z: number): [number, number, number, number] {
  if (z < -0.999999) return [1, 0, 0, 0];
  const w = Math.sqrt(0.5 * (1 + z));
  return [-y / (2 * w), x / (2 * w), 0, w];
}

function poseOf({ pose }: visualization_msgs_Marker): Pose {
  const { position: p, orientation: q } = pose;
  const square = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
  // Many leave the orientation out: then it is none.
  if (!(square > 1e-9)) return [p.x, p.y, p.z, 0, 0, 0, 1];
  const scale = 1 / Math.sqrt(square);
  return [p.x, p.y, p.z, q.x * scale, q.y * scale, q.z * scale, q.w * scale];
}

function colourOf({ color, colors }: visualization_msgs_Marker, i: number): Rgba {
  const { r, g, b, a } = colors[i] ?? color;
  return [r, g, b, a > 0 ? a : color.a > 0 ? color.a : 0];
}
