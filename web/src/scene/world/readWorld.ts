import {
  BufferGeometry,
  Color,
  InstancedMesh,
  Matrix4,
  Mesh,
  type Material,
  type MeshStandardMaterial,
  type Object3D,
  type Texture,
} from "three";

/** A surface of one material. */
export interface Surface {
  geometry: BufferGeometry;
  material: string;
  colour: Color;
  map: Texture | null;
}

/** A shape that stands many times. */
export interface Model {
  parts: Surface[];
  /** 16 numbers each, map from model. */
  transforms: Float32Array;
}

/** What stands once, where it is in the map. */
export interface Solid extends Surface {
  name: string;
  transform: Matrix4;
}

export interface WorldContent {
  solids: Solid[];
  models: Model[];
}

/** ENU from glTF's axes: x, -z, y. */
const ENU_FROM_GLTF = new Matrix4().set(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1);

/**
 * What a glTF holds, in the map's axes: instances (EXT_mesh_gpu_instancing) and nodes that share
 * their meshes become models with transforms; all else stays as it is.
 */
export function readWorld(root: Object3D): WorldContent {
  root.updateMatrixWorld(true);
  const groups = new Map<string, { surfaces: Surface[]; name: string; transforms: Matrix4[] }>();
  root.traverse((node) => {
    const meshes = meshesOf(node, root);
    if (meshes.length === 0) return;
    const key = meshes.map(({ geometry }) => geometry.uuid).join(" ");
    let group = groups.get(key);
    if (group === undefined) {
      group = { surfaces: meshes.map(surfaceOf), name: node.name, transforms: [] };
      groups.set(key, group);
    }
    group.transforms.push(...transformsOf(meshes[0]!));
  });
  const content: WorldContent = { solids: [], models: [] };
  for (const { surfaces, name, transforms } of groups.values()) {
    const grows = surfaces.some(({ material }) => material === "wood" || material === "leaf");
    if (transforms.length > 1 || grows) content.models.push(modelOf(surfaces, transforms));
    else
      for (const surface of surfaces)
        content.solids.push({
          ...surface,
          name,
          transform: ENU_FROM_GLTF.clone().multiply(transforms[0]!),
        });
  }
  return content;
}

/** The meshes of one glTF node: itself, or its children where its mesh has several materials. */
function meshesOf(node: Object3D, root: Object3D): Mesh[] {
  if (node instanceof Mesh) return isBundle(node.parent, root) ? [] : [node];
  return isBundle(node, root) ? (node.children as Mesh[]) : [];
}

/** Whether the loader has split one mesh by its materials into the children of a group. */
function isBundle(node: Object3D | null, root: Object3D): boolean {
  if (node === null || node === root || node.children.length < 2) return false;
  return node.children.every(
    (child) =>
      child instanceof InstancedMesh || (child instanceof Mesh && child.matrix.equals(IDENTITY)),
  );
}

const IDENTITY = new Matrix4();

function transformsOf(mesh: Mesh): Matrix4[] {
  if (!(mesh instanceof InstancedMesh)) return [mesh.matrixWorld.clone()];
  return Array.from({ length: mesh.count }, (_, i) => {
    const transform = new Matrix4();
    mesh.getMatrixAt(i, transform);
    return transform.premultiply(mesh.matrixWorld);
  });
}

function surfaceOf(mesh: Mesh): Surface {
  const material = (Array.isArray(mesh.material) ? mesh.material[0] : mesh.material) as Material;
  const standard = material as MeshStandardMaterial;
  return {
    geometry: mesh.geometry,
    material: material.name,
    colour: standard.color?.clone() ?? new Color(0.5, 0.5, 0.5),
    map: standard.map ?? null,
  };
}

/** Models are turned to z up themselves, so that transforms only say where they stand. */
function modelOf(surfaces: Surface[], transforms: Matrix4[]): Model {
  const back = ENU_FROM_GLTF.clone().invert();
  const matrices = new Float32Array(16 * transforms.length);
  const transform = new Matrix4();
  transforms.forEach((given, i) => {
    transform
      .multiplyMatrices(ENU_FROM_GLTF, given)
      .multiply(back)
      .toArray(matrices, 16 * i);
  });
  const parts = surfaces.map((surface) => ({
    ...surface,
    geometry: surface.geometry.clone().applyMatrix4(ENU_FROM_GLTF),
  }));
  return { parts, transforms: matrices };
}
