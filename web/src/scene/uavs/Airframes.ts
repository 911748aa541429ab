import {
  type BufferGeometry,
  CircleGeometry,
  DynamicDrawUsage,
  Group,
  InstancedBufferAttribute,
  InstancedMesh,
  MeshStandardMaterial,
  ShaderMaterial,
  UniformsLib,
  UniformsUtils,
} from "three";
import { FADE } from "../air/fog.ts";
import { POSE } from "../../link/protocol.ts";
import { rotated, product, putMatrix, rotationOf } from "../stage/poses.ts";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import type { AirframeShape } from "./airframes.generated.ts";
import { bladesOf, bodyOf, radiusOf, shapeOf } from "./airframeGeometry.ts";
import { CRASHED } from "./colours.ts";
import { Dots } from "./Dots.ts";
import { fleet, type ShownUav } from "./fleet.ts";

/** So fast blades are shown to turn at full speed, rad/s: what a screen can show. */
const SPIN_RAD_S = 26;
/** Above this share of full speed rotors are discs. */
const BLUR = 0.25;
/** A wreck that its pose leaves upright lies on its side, rad. */
const WRECK_TILT = 0.55;
/** A UAV whose radius on the screen is smaller has no rotors, CSS pixels. */
const ROTORS_PX = 8;
/** Below this radius it is a dot, CSS pixels. */
const DOT_PX = 2;

/** What a frame shows of UAVs: how large they are on the screen decides how much. */
interface Sight {
  stepS: number;
  eye: { x: number; y: number; z: number };
  /** CSS pixels of a metre at a distance of one metre. */
  scale: number;
  dots: Dots;
  /** Whether bodies have the colour of their UAV instead of their own ones. */
  coloured: boolean;
}

/** All UAVs as what they are: three draw calls for each kind of airframe, one for all far ones. */
export class Airframes implements Part {
  readonly object = new Group();
  private kinds: Kind[] = [];
  private dots = new Dots(0, DOT_PX);
  private version = -1;

  update({ stepS, camera, height, renderer }: Moment): void {
    if (fleet.version !== this.version) this.rebuild();
    const scale = height / (2 * Math.tan((camera.fov * Math.PI) / 360));
    const { dots } = this;
    dots.begin();
    const sight = { stepS, eye: camera.position, scale, dots, coloured: fleet.coloured };
    for (const kind of this.kinds) kind.update(sight);
    dots.end(renderer.getPixelRatio());
  }

  dispose(): void {
    for (const kind of this.kinds) kind.dispose();
    this.dots.dispose();
    this.object.clear();
  }

  private rebuild(): void {
    this.version = fleet.version;
    this.dispose();
    const byName = new Map<string, number[]>();
    fleet.uavs.forEach(({ airframe }, i) => {
      const members = byName.get(airframe);
      if (members === undefined) byName.set(airframe, [i]);
      else members.push(i);
    });
    this.kinds = [...byName].map(([airframe, members]) => new Kind(airframe, members));
    this.dots = new Dots(fleet.uavs.length, DOT_PX);
    for (const kind of this.kinds) this.object.add(...kind.meshes);
    this.object.add(this.dots.object);
  }
}

const rotation = new Float64Array(9);
const turned = new Float64Array(9);
const spun = new Float64Array(9);
const offset = new Float64Array(3);

/** All UAVs of one airframe. */
class Kind {
  readonly meshes: InstancedMesh[];
  private readonly shape: AirframeShape;
  private readonly radius: number;
  private readonly body: InstancedMesh<BufferGeometry, MeshStandardMaterial>;
  private readonly blades: InstancedMesh;
  private readonly discs: InstancedMesh;
  /** Of each member's rotors, rad. */
  private readonly angles: Float64Array;
  /** Bodies and rotors of this frame so far. */
  private bodies = 0;
  private rotors = 0;

  constructor(
    airframe: string,
    private readonly members: readonly number[],
  ) {
    this.shape = shapeOf(airframe);
    this.radius = radiusOf(airframe);
    const rotors = members.length * this.shape.rotors.length;
    this.body = instanced(new InstancedMesh(bodyOf(airframe), painted(), members.length));
    const white = new Float32Array(3 * members.length).fill(1);
    this.body.instanceColor = new InstancedBufferAttribute(white, 3).setUsage(DynamicDrawUsage);
    this.blades = instanced(new InstancedMesh(bladesOf(), painted(), rotors));
    this.discs = instanced(new InstancedMesh(new CircleGeometry(1, 28), discMaterial(), rotors));
    this.body.castShadow = this.blades.castShadow = true;
    this.body.receiveShadow = true;
    this.discs.renderOrder = 1400;
    this.meshes = [this.body, this.blades, this.discs];
    this.angles = Float64Array.from(members, (member) => 1.7 * member);
  }

  update(sight: Sight): void {
    this.bodies = this.rotors = 0;
    this.paint(sight.coloured);
    this.members.forEach((member, i) => this.move(i, fleet.uavs[member], sight));
    showFirst(this.body, this.bodies);
    showFirst(this.blades, this.rotors);
    showFirst(this.discs, this.rotors);
    if (sight.coloured) this.body.instanceColor!.needsUpdate = true;
  }

  /** Give bodies the colours of their UAVs, or their own ones back. */
  private paint(coloured: boolean): void {
    const { material, instanceColor } = this.body;
    if (material.vertexColors === !coloured) return;
    material.vertexColors = !coloured;
    material.needsUpdate = true;
    instanceColor!.array.fill(1);
    instanceColor!.needsUpdate = true;
  }

  private move(i: number, uav: ShownUav | undefined, sight: Sight): void {
    const at = (uav?.row ?? -1) * POSE;
    const { poses } = shown;
    if (uav === undefined || at < 0 || !Number.isFinite(poses[at]! + poses[at + 6]!)) return;
    const speed = uav.crashed ? 0 : uav.rotorSpeed;
    this.angles[i] =
      (this.angles[i]! + Math.sqrt(speed) * SPIN_RAD_S * sight.stepS) % (2 * Math.PI);
    const [x, y, z] = [poses[at]!, poses[at + 1]!, poses[at + 2]!];
    const { eye } = sight;
    const radiusPx = (this.radius * sight.scale) / Math.hypot(x - eye.x, y - eye.y, z - eye.z);
    if (radiusPx < DOT_PX) {
      sight.dots.put(x, y, z, uav.crashed ? CRASHED : uav.colour);
      return;
    }
    rotationOf(poses, at, rotation);
    if (uav.crashed && rotation[8]! > 0.9) tilt(rotation);
    const body = this.bodies++;
    putMatrix(this.body.instanceMatrix.array, body, rotation, 1, x, y, z);
    if (sight.coloured) this.body.instanceColor!.set(uav.colour, 3 * body);
    if (radiusPx >= ROTORS_PX) this.turn(this.angles[i]!, x, y, z, speed);
  }

  private turn(angle: number, x: number, y: number, z: number, speed: number): void {
    const { rotors, rotorRadius } = this.shape;
    const blurred = speed > BLUR;
    for (const rotor of rotors) {
      rotated(rotation, rotor, 0, offset);
      leaning(rotor, turned);
      product(rotation, turned, spun);
      spin(spun, angle * rotor[6]!);
      const at = this.rotors++;
      const [px, py, pz] = [x + offset[0]!, y + offset[1]!, z + offset[2]!];
      putMatrix(this.blades.instanceMatrix.array, at, spun, rotorRadius, px, py, pz);
      putMatrix(this.discs.instanceMatrix.array, at, spun, blurred ? rotorRadius : 0, px, py, pz);
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

function painted(): MeshStandardMaterial {
  return new MeshStandardMaterial({ vertexColors: true, roughness: 0.55, metalness: 0.1 });
}

function instanced<M extends InstancedMesh>(mesh: M): M {
  mesh.instanceMatrix.setUsage(DynamicDrawUsage);
  mesh.frustumCulled = false; // they are spread over the whole world
  return mesh;
}

/** Draw the first instances alone, and send no more than those. */
function showFirst(mesh: InstancedMesh, count: number): void {
  mesh.count = count;
  mesh.visible = count > 0;
  if (count === 0) return;
  mesh.instanceMatrix.clearUpdateRanges();
  mesh.instanceMatrix.addUpdateRange(0, 16 * count);
  mesh.instanceMatrix.needsUpdate = true;
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
