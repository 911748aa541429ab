import {
  BufferAttribute,
  CanvasTexture,
  DynamicDrawUsage,
  Group,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  LinearFilter,
  Mesh,
  ShaderMaterial,
  Vector2,
  Vector3,
} from "three";
import { POSE } from "../../link/protocol.ts";
import { useVehicles } from "../../state/vehicles.ts";
import { useView } from "../../state/view.ts";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import { fleet, type ShownUav } from "./fleet.ts";
import { chooseLabels, MAX_LABELS, type Box } from "./labelPositions.ts";
import { NameCells } from "./nameCells.ts";

/** Pixels of one name in the texture of names. */
const CELL = { width: 192, height: 32 };
const COLUMNS = 8;
/** Names in the texture: those that are shown, and some that were and may be again. */
const CELLS = 2 * MAX_LABELS;
const ROWS = CELLS / COLUMNS;
const FONT = "600 21px Inter, system-ui, sans-serif";
const HEIGHT_PX = 17;
const MARGIN_PX = 10;
/** Names are chosen again so often, ms: which of them would overlap changes slowly. */
const CHOOSE_MS = 120;
const ABOVE_M = 0.12;

const WHITE = [1, 1, 1] as const;
const RED = [1, 0.35, 0.3] as const;
const BRIGHT = [0.45, 0.92, 1] as const;

/** Names of UAVs above them: one draw call, none over another. */
export class Labels implements Part {
  readonly object = new Group();
  private readonly canvas = document.createElement("canvas");
  private readonly texture: CanvasTexture;
  private readonly mesh: Mesh<InstancedBufferGeometry, ShaderMaterial>;
  /** Of each name, in heights of a label. */
  private readonly widths = new Map<string, number>();
  private readonly cells = new NameCells(CELLS);
  private chosen: number[] = [];
  private chosenMs = 0;
  private version = -1;
  private readonly point = new Vector3();

  constructor() {
    this.canvas.width = COLUMNS * CELL.width;
    this.canvas.height = ROWS * CELL.height;
    this.texture = new CanvasTexture(this.canvas);
    this.texture.minFilter = LinearFilter;
    this.texture.generateMipmaps = false;
    this.mesh = new Mesh(geometryOf(), this.material());
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 4000;
    this.object.add(this.mesh);
  }

  update(moment: Moment): void {
    const { names } = useView.getState().show;
    if (fleet.version !== this.version || moment.nowMs - this.chosenMs > CHOOSE_MS) {
      this.version = fleet.version;
      this.chosenMs = moment.nowMs;
      this.chosen = this.choose(moment, names);
      this.write(this.chosen.map((i) => fleet.uavs[i]!.name));
    }
    this.arrange(moment);
  }

  dispose(): void {
    this.texture.dispose();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }

  /** Write names into the texture that are not in it. */
  private write(names: readonly string[]): void {
    const fresh = this.cells.hold(names);
    const context = this.canvas.getContext("2d");
    if (fresh.length === 0 || context === null) return;
    context.font = FONT;
    context.textBaseline = "middle";
    for (const [name, cell] of fresh) {
      const x = (cell % COLUMNS) * CELL.width;
      const y = Math.floor(cell / COLUMNS) * CELL.height;
      context.clearRect(x, y, CELL.width, CELL.height);
      context.fillStyle = "rgba(14, 18, 24, 0.66)";
      context.beginPath();
      context.roundRect(x, y, this.widthOf(name) * CELL.height, CELL.height, 9);
      context.fill();
      context.fillStyle = "white";
      context.fillText(name, x + 10, y + CELL.height / 2 + 1, CELL.width - 20);
    }
    this.texture.needsUpdate = true;
  }

  /** Width of a name's label, in heights of it. */
  private widthOf(name: string): number {
    let width = this.widths.get(name);
    if (width === undefined) {
      const context = this.canvas.getContext("2d");
      if (context !== null) context.font = FONT;
      width = Math.min(CELL.width, (context?.measureText(name).width ?? 0) + 20) / CELL.height;
      this.widths.set(name, width);
    }
    return width;
  }

  /** Names that are seen and do not overlap; the selected and the hovered one before the others. */
  private choose({ camera, width, height }: Moment, all: boolean): number[] {
    const { selected } = useVehicles.getState();
    const { hovered } = useView.getState();
    const boxes: Box[] = [];
    fleet.uavs.forEach(({ name, row }, i) => {
      const wanted = name === hovered ? 2 : name === selected ? 1 : 0;
      if (row < 0 || (!all && wanted === 0)) return;
      this.point.fromArray(shown.poses, row * POSE);
      const away = this.point.distanceTo(camera.position);
      this.point.project(camera);
      const { x, y, z } = this.point;
      if (!(Math.abs(x) < 1.05 && Math.abs(y) < 1.05 && Math.abs(z) < 1)) return;
      const wide = this.widthOf(name) * HEIGHT_PX;
      const left = (0.5 + 0.5 * x) * width - wide / 2;
      const top = (0.5 - 0.5 * y) * height - HEIGHT_PX;
      boxes.push({ id: i, left, top, width: wide, height: HEIGHT_PX, rank: 1e6 * wanted - away });
    });
    return chooseLabels(boxes);
  }

  private arrange({ width, height }: Moment): void {
    const { geometry, material } = this.mesh;
    const origin = geometry.getAttribute("origin") as InstancedBufferAttribute;
    const look = geometry.getAttribute("look") as InstancedBufferAttribute;
    const tint = geometry.getAttribute("tint") as InstancedBufferAttribute;
    const { selected } = useVehicles.getState();
    let count = 0;
    for (const i of this.chosen) {
      const uav = fleet.uavs[i];
      if (uav === undefined || uav.row < 0) continue;
      const at = uav.row * POSE;
      origin.setXYZ(count, shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]! + ABOVE_M);
      const cell = this.cells.cellOf(uav.name);
      look.setXYZ(count, this.widthOf(uav.name), cell % COLUMNS, Math.floor(cell / COLUMNS));
      tint.setXYZ(count, ...tintOf(uav, selected));
      count++;
    }
    geometry.instanceCount = count;
    this.mesh.visible = count > 0;
    for (const attribute of [origin, look, tint]) attribute.needsUpdate = true;
    material.uniforms.size!.value.set(width, height);
  }

  private material(): ShaderMaterial {
    return new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: { names: { value: this.texture }, size: { value: new Vector2(1, 1) } },
      transparent: true,
      depthTest: false,
      depthWrite: false,
    });
  }
}

function tintOf({ name, crashed }: ShownUav, selected: string): readonly [number, number, number] {
  if (crashed) return RED;
  return name === selected ? BRIGHT : WHITE;
}

function geometryOf(): InstancedBufferGeometry {
  const geometry = new InstancedBufferGeometry();
  const corners = new Float32Array([-0.5, 0, 0, 0.5, 0, 0, 0.5, 1, 0, -0.5, 1, 0]);
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  for (const name of ["origin", "look", "tint"]) {
    const attribute = new InstancedBufferAttribute(new Float32Array(3 * MAX_LABELS), 3);
    geometry.setAttribute(name, attribute.setUsage(DynamicDrawUsage));
  }
  return geometry;
}

const VERTEX = /* glsl */ `
attribute vec3 origin, look, tint;
uniform vec2 size;
varying vec2 vUv;
varying vec3 vTint;
void main() {
  vec4 at = projectionMatrix * viewMatrix * vec4(origin, 1.0);
  vec2 pixels = vec2(position.x * look.x, position.y) * ${HEIGHT_PX.toFixed(1)} + vec2(0.0, ${MARGIN_PX.toFixed(1)});
  at.xy += pixels * 2.0 / size * at.w;
  gl_Position = at;
  vec2 inCell = vec2((position.x + 0.5) * look.x * ${(CELL.height / CELL.width).toFixed(6)}, 1.0 - position.y);
  vUv = (look.yz + inCell) / vec2(${COLUMNS.toFixed(1)}, ${ROWS.toFixed(1)});
  vUv.y = 1.0 - vUv.y;
  vTint = tint;
}
`;

const FRAGMENT = /* glsl */ `
uniform sampler2D names;
varying vec2 vUv;
varying vec3 vTint;
void main() {
  gl_FragColor = texture2D(names, vUv) * vec4(vTint, 1.0);
}
`;
