import {
  CircleGeometry,
  DynamicDrawUsage,
  Group,
  InstancedMesh,
  MeshStandardMaterial,
  ShaderMaterial,
  UniformsLib,
  UniformsUtils,
} from "three";
import { FADE } from "../air/fog.ts";
import { POSE } from "../../link/protocol.ts";
import { placed, product, putMatrix, rotationOf } from "../stage/poses.ts";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import type { AirframeShape } from "./airframes.generated.ts";
import { bladesOf, bodyOf, shapeOf } from "./airframeGeometry.ts";
import { fleet, type ShownUav } from "./fleet.ts";

/** So fast blades are shown to turn at full speed, rad/s: what a screen can show. */
const SPIN_RAD_S = 26;
/** Above this share of full speed rotors are discs. */
const BLUR = 0.25;
/** A wreck that its pose leaves upright lies on its side, rad. */
const WRECK_TILT = 0.55;

/** All UAVs as what they are: three draw calls for each kind of airframe. */
export class Airframes implements Part {
  readonly object = new Group();
  private kinds: Kind[] = [];
  private version = -1;

  update({ stepS }: Moment): void {
    if (fleet.version !== this.version) this.rebuild();
    for (const kind of this.kinds) kind.update(stepS);
  }

  dispose(): void {
    for (const kind of this.kinds) kind.dispose();
    this.object.clear();
  }

  private rebuild(): void {
    this.version = fleet.version;
    this.dispose();
    const byName = new Map<string, number[]>();
    fleet.uavs.forEach(({ airframe }, i) => {
      byName.set(airframe, [...(byName.get(airframe) ?? []), i]);
    });
    this.kinds = [...byName].map(([airframe, members]) => new Kind(airframe, members));
    for (const kind of this.kinds) this.object.add(...kind.meshes);
  }
}

const rotation = new Float64Array(9);
const turned = new Float64Array(9);
const spun = new Float64Array(9);
const place = new Float64Array(3);

/** All UAVs of one airframe. */
class Kind {
  readonly meshes: InstancedMesh[];
  private readonly shape: AirframeShape;
  private readonly body: InstancedMesh;
  private readonly blades: InstancedMesh;
  private readonly discs: InstancedMesh;
  /** Of each member's rotors, rad. */
  private readonly angles: Float64Array;

  constructor(
    airframe: string,
    private readonly members: readonly number[],
  ) {
    this.shape = shapeOf(airframe);
    const rotors = members.length * this.shape.rotors.length;
    const painted = new MeshStandardMaterial({
      vertexColors: true,
      roughness: 0.55,
      metalness: 0.1,
    });
    this.body = instanced(new InstancedMesh(bodyOf(airframe), painted, members.length));
    this.blades = instanced(new InstancedMesh(bladesOf(), painted, rotors));
    this.discs = instanced(new InstancedMesh(new CircleGeometry(1, 28), discMaterial(), rotors));
    this.body.castShadow = this.blades.castShadow = true;
    this.body.receiveShadow = true;
    this.discs.renderOrder = 1400;
    this.meshes = [this.body, this.blades, this.discs];
    this.angles = Float64Array.from(members, (member) => 1.7 * member);
  }

  update(stepS: number): void {
    this.members.forEach((member, i) => this.move(i, fleet.uavs[member], stepS));
    for (const mesh of this.meshes) mesh.instanceMatrix.needsUpdate = true;
  }

  private move(i: number, uav: ShownUav | undefined, stepS: number): void {
    const at = (uav?.row ?? -1) * POSE;
    const { poses } = shown;
    if (uav === undefined || at < 0 || !Number.isFinite(poses[at]! + poses[at + 6]!)) {
      this.hide(i);
      return;
    }
    rotationOf(poses, at, rotation);
    if (uav.crashed && rotation[8]! > 0.9) tilt(rotation);
    const [x, y, z] = [poses[at]!, poses[at + 1]!, poses[at + 2]!];
    putMatrix(this.body.instanceMatrix.array, i, rotation, 1, x, y, z);
    const speed = uav.crashed ? 0 : uav.rotorSpeed;
    this.angles[i] = (this.angles[i]! + Math.sqrt(speed) * SPIN_RAD_S * stepS) % (2 * Math.PI);
    this.turn(i, x, y, z, speed);
  }

  private turn(i: number, x: number, y: number, z: number, speed: number): void {
    const { rotors, rotorRadius } = this.shape;
    const blurred = speed > BLUR;
    for (let k = 0; k < rotors.length; k++) {
      const rotor = rotors[k]!;
      placed(rotation, rotor, 0, place);
      leaning(rotor, turned);
      product(rotation, turned, spun);
      spin(spun, this.angles[i]! * rotor[6]!);
      const at = i * rotors.length + k;
      const [px, py, pz] = [x + place[0]!, y + place[1]!, z + place[2]!];
      putMatrix(this.blades.instanceMatrix.array, at, spun, rotorRadius, px, py, pz);
      putMatrix(this.discs.instanceMatrix.array, at, spun, blurred ? rotorRadius : 0, px, py, pz);
    }
  }

  private hide(i: number): void {
    const { length } = this.shape.rotors;
    putMatrix(this.body.instanceMatrix.array, i, rotation, 0, 0, 0, 0);
    for (let at = i * length; at < (i + 1) * length; at++) {
      putMatrix(this.blades.instanceMatrix.array, at, rotation, 0, 0, 0, 0);
      putMatrix(this.discs.instanceMatrix.array, at, rotation, 0, 0, 0, 0);
    }
  }

  dispose(): void {
    for (const mesh of this.meshes) {
      mesh.geometry.dispose();
      mesh.dispose();
      for (const material of [mesh.material].flat()) material.dispose();
    }
  }
}

function instanced(mesh: InstancedMesh): InstancedMesh {
  mesh.instanceMatrix.setUsage(DynamicDrawUsage);
  mesh.frustumCulled = false; // they are spread over the whole world
  return mesh;
}

/** Lay a wreck on its side: turn it about its own x axis. */
function tilt(r: Float64Array): void {
  turned.set([
    1,
    0,
    0,
    0,
    Math.cos(WRECK_TILT),
    -Math.sin(WRECK_TILT),
    0,
    Math.sin(WRECK_TILT),
    Math.cos(WRECK_TILT),
  ]);
  product(r, turned, spun);
  r.set(spun);
}

/** Rotation that leads z to the rotor's axis. */
function leaning(rotor: readonly number[], out: Float64Array): void {
  const [x, y, z] = [rotor[3]!, rotor[4]!, rotor[5]!];
  const k = 1 / (1 + z);
  if (!Number.isFinite(k)) {
    out.set([1, 0, 0, 0, -1, 0, 0, 0, -1]);
    return;
  }
  out[0] = 1 - k * x * x;
  out[1] = -k * x * y;
  out[2] = x;
  out[3] = -k * x * y;
  out[4] = 1 - k * y * y;
  out[5] = y;
  out[6] = -x;
  out[7] = -y;
  out[8] = z;
}

/** Turn about the own z axis. */
function spin(r: Float64Array, angle: number): void {
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  for (let i = 0; i < 9; i += 3) {
    const x = r[i]!;
    const y = r[i + 1]!;
    r[i] = c * x + s * y;
    r[i + 1] = c * y - s * x;
  }
}

/** What the eye sees of fast blades: a veil, denser towards the tips. */
function discMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: DISC_VERTEX,
    fragmentShader: DISC_FRAGMENT,
    uniforms: UniformsUtils.clone(UniformsLib.fog),
    transparent: true,
    depthWrite: false,
    side: 2,
    fog: true,
  });
}

const DISC_VERTEX = /* glsl */ `
#include <fog_pars_vertex>
varying vec2 vOn;
void main() {
  vOn = position.xy;
  vec4 mvPosition = modelViewMatrix * instanceMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * mvPosition;
  #include <fog_vertex>
}
`;

const DISC_FRAGMENT = /* glsl */ `
#include <fog_pars_fragment>
varying vec2 vOn;
void main() {
  float far = length(vOn);
  float veil = 0.16 + 0.14 * smoothstep(0.5, 0.95, far) - 0.1 * smoothstep(0.95, 1.0, far);
  gl_FragColor = vec4(vec3(0.055), veil);
  ${FADE}
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;
