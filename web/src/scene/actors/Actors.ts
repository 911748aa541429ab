import { DynamicDrawUsage, Group, InstancedMesh, MeshStandardMaterial } from "three";
import { link } from "../../link/link.ts";
import { POSE } from "../../link/protocol.ts";
import { useConnection } from "../../state/connection.ts";
import type { Moment, Part } from "../stage/part.ts";
import { putMatrix, rotationOf } from "../stage/poses.ts";
import { shown } from "../stage/shown.ts";
import { bodyOfActor } from "./bodies.ts";
import { kindOf, kindsVersion, tagPrintOf, type ActorKind } from "./kinds.ts";
import type { TagPrint } from "./tagPrint.ts";

/** Wings beat: the whole bird is tilted a little to and fro. */
const BEAT_RAD_S = 9;
const rotation = new Float64Array(9);

/** Actors (people, cars, birds and tags): frames of the simulation's own that belong to no UAV. */
export class Actors implements Part {
  readonly object = new Group();
  private version = "";
  private readonly material = new MeshStandardMaterial({ vertexColors: true, roughness: 0.7 });
  private kinds: { mesh: InstancedMesh; rows: number[]; kind: ActorKind }[] = [];

  update({ nowMs }: Moment): void {
    const version = `${link.frames.version} ${kindsVersion} ${useConnection.getState().volery}`;
    if (version !== this.version) {
      this.version = version;
      this.rebuild();
    }
    for (const { mesh, rows, kind } of this.kinds) {
      const beat = kind === "bird" ? 1 + 0.12 * Math.sin((nowMs / 1000) * BEAT_RAD_S) : 1;
      rows.forEach((row, i) => place(mesh, i, row * POSE, beat));
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  dispose(): void {
    for (const { mesh } of this.kinds) {
      mesh.geometry.dispose();
      mesh.dispose();
    }
    this.object.clear();
    this.kinds = [];
  }

  private rebuild(): void {
    this.dispose();
    if (!useConnection.getState().volery) return; // a robot's frames are parts of itself
    const bodies = new Map<string, { kind: ActorKind; print: TagPrint | null; rows: number[] }>();
    link.frames.names.forEach((name, row) => {
      if (name.includes("/") || name === "map" || name === "base_link") return;
      const kind = kindOf(name);
      const print = tagPrintOf(name);
      const key = print === null ? kind : `${kind} ${print.code} ${print.sizeM}`;
      const body = bodies.get(key) ?? { kind, print, rows: [] };
      body.rows.push(row);
      bodies.set(key, body);
    });
    for (const { kind, print, rows } of bodies.values()) {
      const mesh = new InstancedMesh(bodyOfActor(kind, print), this.material, rows.length);
      mesh.instanceMatrix.setUsage(DynamicDrawUsage);
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.frustumCulled = false;
      this.object.add(mesh);
      this.kinds.push({ mesh, rows, kind });
    }
  }
}

function place(mesh: InstancedMesh, i: number, at: number, beat: number): void {
  const { poses } = shown;
  const known = Number.isFinite(poses[at]! + poses[at + 6]!);
  if (known) rotationOf(poses, at, rotation);
  for (const k of [2, 5, 8]) rotation[k]! *= beat;
  putMatrix(
    mesh.instanceMatrix.array,
    i,
    rotation,
    known ? 1 : 0,
    known ? poses[at]! : 0,
    known ? poses[at + 1]! : 0,
    known ? poses[at + 2]! : 0,
  );
}
