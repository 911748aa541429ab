// Geometry as the scene needs it, from geometry as the glTF has it.

import { BufferAttribute, BufferGeometry, type Color, type Matrix4, Vector3 } from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { randoms } from "./noiseTexture.ts";

/** How much larger than its leaves a triangle of a crown is that is cut out by leaves. */
const LEAF_GROWTH = 1.55;
const CREASE = 0.6;

/** Rounded where edges are shallow; kept where the file has normals. */
export function withNormals(geometry: BufferGeometry, rounded: boolean): BufferGeometry {
  if (geometry.hasAttribute("normal")) return geometry;
  if (rounded) {
    geometry.computeVertexNormals();
    return geometry;
  }
  return toCreasedNormals(geometry, CREASE);
}

/**
 * A crown: each triangle a twig that is cut out by an image of leaves, larger by as much as that
 * takes away; normals lead away from the crown's middle, so that it is lit as one soft body.
 */
export function crownOf(geometry: BufferGeometry): BufferGeometry {
  const loose = geometry.index === null ? geometry.clone() : geometry.toNonIndexed();
  const position = loose.getAttribute("position");
  loose.computeBoundingBox();
  const middle = loose.boundingBox!.getCenter(new Vector3());
  middle.z = loose.boundingBox!.min.z + 0.3 * (loose.boundingBox!.max.z - loose.boundingBox!.min.z);
  const normals = new Float32Array(3 * position.count);
  const uvs = new Float32Array(2 * position.count);
  const random = randoms(position.count);
  const corners = [new Vector3(), new Vector3(), new Vector3()];
  const centre = new Vector3();
  for (let i = 0; i + 2 < position.count; i += 3) {
    corners.forEach((corner, k) => corner.fromBufferAttribute(position, i + k));
    centre.copy(corners[0]!).add(corners[1]!).add(corners[2]!).divideScalar(3);
    const first = Math.floor(3 * random());
    corners.forEach((corner, k) => {
      corner.sub(centre).multiplyScalar(LEAF_GROWTH).add(centre);
      position.setXYZ(i + k, corner.x, corner.y, corner.z);
      uvs.set(
        [
          [0, 0],
          [1, 0],
          [0.5, 1],
        ][(k + first) % 3]!,
        2 * (i + k),
      );
      corner.sub(middle).normalize();
      normals.set([corner.x, corner.y, corner.z], 3 * (i + k));
    });
  }
  loose.setAttribute("normal", new BufferAttribute(normals, 3));
  loose.setAttribute("uv", new BufferAttribute(uvs, 2));
  return loose;
}

/** Shapes as one, where they stand; each vertex has its colour and the height of its shape's foot. */
export function merged(
  pieces: readonly { geometry: BufferGeometry; transform: Matrix4; colour: Color }[],
  rounded: boolean,
): BufferGeometry {
  const ready = pieces.map(({ geometry, transform, colour }) => {
    const own = withNormals(geometry.clone().applyMatrix4(transform), rounded);
    own.computeBoundingBox();
    return { own, colour, base: own.boundingBox!.min.z };
  });
  const count = ready.reduce((sum, { own }) => sum + own.getAttribute("position").count, 0);
  const out = {
    position: new Float32Array(3 * count),
    normal: new Float32Array(3 * count),
    color: new Float32Array(3 * count),
    uv: new Float32Array(2 * count),
    base: new Float32Array(count),
  };
  const index: number[] = [];
  let at = 0;
  for (const { own, colour, base } of ready) {
    const { position, normal, uv } = own.attributes;
    const vertices = position!.count;
    out.position.set(position!.array as Float32Array, 3 * at);
    out.normal.set(normal!.array as Float32Array, 3 * at);
    if (uv !== undefined) out.uv.set(uv.array as Float32Array, 2 * at);
    for (let i = at; i < at + vertices; i++) out.color.set([colour.r, colour.g, colour.b], 3 * i);
    out.base.fill(base, at, at + vertices);
    const corners = own.index?.array ?? Array.from({ length: vertices }, (_, i) => i);
    for (const corner of corners) index.push(at + corner);
    at += vertices;
  }
  const geometry = new BufferGeometry();
  for (const [name, array] of Object.entries(out))
    geometry.setAttribute(name, new BufferAttribute(array, array.length / count));
  geometry.setIndex(index);
  return geometry;
}
