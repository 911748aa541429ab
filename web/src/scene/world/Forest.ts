import { Frustum, Group, InstancedMesh, Matrix4, Vector3, type WebGLRenderer } from "three";
import type { Air } from "../air/air.ts";
import type { Moment, Part } from "../stage/part.ts";
import { DistantTrees } from "./DistantTrees.ts";
import { finishOf } from "./finishes.ts";
import { worldMaterial } from "./materials.ts";
import type { Model } from "./readWorld.ts";
import { crownOf, withNormals } from "./shapes.ts";
import { TreeCells, TURN_RAD, type Chosen } from "./treeCells.ts";

/** Trees are chosen again when the camera has moved so far, m. */
const MOVE_M = 3;

/** Trees: whole ones near the camera, impostors beyond; few draw calls for thousands. */
export class Forest implements Part {
  readonly object = new Group();
  /** Whether the trees around the camera were chosen again: their shadows are others. */
  changed = false;

  private readonly meshes: InstancedMesh[][];
  private readonly distant: DistantTrees;
  private readonly cells: TreeCells;
  private readonly chosen: Chosen[];
  private readonly eye = new Vector3(Infinity, 0, 0);
  private readonly direction = new Vector3();
  private readonly directionNow = new Vector3();
  private readonly frustum = new Frustum();
  private readonly matrix = new Matrix4();
  private wholeM = -1;
  private fov = 0;

  constructor(
    private readonly models: readonly Model[],
    air: Air,
    renderer: WebGLRenderer,
  ) {
    const shapes = models.map(({ parts }) =>
      parts.map((part) => ({
        ...part,
        geometry: finishOf(part.material).leafy
          ? crownOf(part.geometry)
          : withNormals(part.geometry, true),
      })),
    );
    this.meshes = shapes.map((parts, model) =>
      parts.map(({ geometry, material, colour, map }) => {
        const count = models[model]!.transforms.length / 16;
        const made = worldMaterial(material, colour, map, false);
        const mesh = new InstancedMesh(geometry, made, count);
        mesh.count = 0;
        mesh.castShadow = mesh.receiveShadow = true;
        mesh.frustumCulled = false;
        this.object.add(mesh);
        return mesh;
      }),
    );
    this.distant = new DistantTrees(shapes, models, air, renderer);
    this.object.add(this.distant.object);
    this.cells = new TreeCells(models, this.distant.tallest);
    this.chosen = models.map(() => ({ whole: [], distant: [] }));
  }

  update(moment: Moment): void {
    this.distant.update();
    const { camera, quality } = moment;
    camera.getWorldDirection(this.directionNow);
    this.changed =
      camera.position.distanceTo(this.eye) > MOVE_M ||
      this.directionNow.angleTo(this.direction) > 0.8 * TURN_RAD ||
      quality.wholeTreesM !== this.wholeM ||
      camera.fov !== this.fov;
    if (!this.changed) return;
    this.eye.copy(camera.position);
    this.direction.copy(this.directionNow);
    this.wholeM = quality.wholeTreesM;
    this.fov = camera.fov;
    this.matrix.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    this.frustum.setFromProjectionMatrix(this.matrix);
    this.cells.choose(this.eye, this.frustum, this.wholeM, this.chosen);
    this.chosen.forEach(({ whole }, model) => this.plant(model, whole));
    this.distant.plant(this.chosen);
  }

  /** Put the meshes of a model where its chosen trees stand. */
  private plant(model: number, trees: readonly number[]): void {
    const { transforms } = this.models[model]!;
    for (const mesh of this.meshes[model]!) {
      const { instanceMatrix } = mesh;
      trees.forEach((tree, i) => {
        for (let k = 0; k < 16; k++) instanceMatrix.array[16 * i + k] = transforms[16 * tree + k]!;
      });
      mesh.count = trees.length;
      mesh.visible = trees.length > 0;
      instanceMatrix.clearUpdateRanges();
      instanceMatrix.addUpdateRange(0, 16 * trees.length);
      instanceMatrix.needsUpdate = true;
    }
  }

  dispose(): void {
    for (const mesh of this.meshes.flat()) {
      mesh.geometry.dispose();
      mesh.dispose();
      for (const material of [mesh.material].flat()) material.dispose();
    }
    this.distant.dispose();
  }
}
