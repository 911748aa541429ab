import {
  BufferAttribute,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  ShaderMaterial,
  UniformsLib,
  UniformsUtils,
  type IUniform,
} from "three";

export type ParticleMesh = Mesh<InstancedBufferGeometry, ShaderMaterial>;

interface ParticleSpec {
  vertexShader: string;
  fragmentShader: string;
  uniforms: Record<string, IUniform>;
  /** Attributes of a particle: its components, and the values of all particles. */
  attributes: Record<string, { size: number; values: Float32Array }>;
  renderOrder: number;
}

/** Transparent squares in fog, one a particle: `position` runs from -1 to 1 across each. */
export function particleMesh(spec: ParticleSpec): ParticleMesh {
  const { vertexShader, fragmentShader, uniforms, attributes, renderOrder } = spec;
  const geometry = new InstancedBufferGeometry();
  const corners = new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]);
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  for (const [name, { size, values }] of Object.entries(attributes))
    geometry.setAttribute(name, new InstancedBufferAttribute(values, size));
  const material = new ShaderMaterial({
    vertexShader,
    fragmentShader,
    uniforms: UniformsUtils.merge([UniformsLib.fog, uniforms]),
    transparent: true,
    depthWrite: false,
    fog: true,
  });
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.renderOrder = renderOrder;
  return mesh;
}

export function disposeParticles({ geometry, material }: ParticleMesh): void {
  geometry.dispose();
  material.dispose();
}
