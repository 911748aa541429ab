import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  Group,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshLambertMaterial,
  Quaternion,
  SphereGeometry,
  SRGBColorSpace,
  Vector3,
} from "three";
import { nowMs } from "../../lib/time.ts";
import { link } from "../../link/link.ts";
import type {
  visualization_msgs_Marker,
  visualization_msgs_MarkerArray,
} from "../../messages/generated.ts";
import { useView } from "../../state/view.ts";
import { SegmentLines } from "../lines/SegmentLines.ts";
import { frameOf } from "../stage/frames.ts";
import type { Moment, Part } from "../stage/part.ts";
import { followTopics, type Follower } from "../stage/topics.ts";
import { addPieces, emptyPieces, type Pieces, type Shape } from "./pieces.ts";
import { MarkerStore } from "./store.ts";
import { textSprite } from "./text.ts";

const ONE = "visualization_msgs/msg/Marker";
const MANY = "visualization_msgs/msg/MarkerArray";
const MAX_SHAPES = 120_000;
const MAX_LINES = 60_000;
const MAX_TEXTS = 60;
const REDRAW_MS = 100;

/** Sides of 1, as markers scale them; z is the axis of what is round. */
const GEOMETRIES: Record<Shape, () => BufferGeometry> = {
  cube: () => new BoxGeometry(1, 1, 1),
  sphere: () => new SphereGeometry(0.5, 16, 10),
  cylinder: () => new CylinderGeometry(0.5, 0.5, 1, 16).rotateX(Math.PI / 2),
  cone: () => new ConeGeometry(0.5, 1, 16).rotateX(Math.PI / 2),
};

/** All markers of visualization_msgs. */
export class Markers implements Part {
  readonly object = new Group();
  private readonly store = new MarkerStore();
  private readonly drawn = new Group();
  private readonly lines = new SegmentLines(MAX_LINES, { pixels: false });
  private readonly follower: Follower;
  private shownVersion = 0;
  private framesVersion = 0;
  private drawnMs = 0;

  constructor() {
    this.object.add(this.drawn, this.lines.object);
    this.follower = followTopics(
      [ONE, MANY],
      (topic, type) =>
        link.subscribe(
          topic,
          type,
          ({ message }) => {
            const list =
              type === MANY
                ? (message as visualization_msgs_MarkerArray).markers
                : [message as visualization_msgs_Marker];
            this.store.take(topic, list, nowMs());
          },
          { depth: 20 },
        ),
      (topic) => this.store.forget(`${topic} `),
    );
  }

  update(moment: Moment): void {
    const { markers } = useView.getState().show;
    this.follower.enable(markers);
    this.object.visible = markers;
    this.store.expire(moment.nowMs);
    this.lines.update(moment);
    const { version } = link.frames;
    const due = moment.nowMs - this.drawnMs > REDRAW_MS;
    if (!due || (this.store.version === this.shownVersion && version === this.framesVersion))
      return;
    this.drawnMs = moment.nowMs;
    this.shownVersion = this.store.version;
    this.framesVersion = version;
    this.redraw();
  }

  dispose(): void {
    this.follower.end();
    this.clear();
    this.lines.dispose();
  }

  private redraw(): void {
    this.clear();
    const pieces = emptyPieces();
    for (const { marker } of this.store.kept.values())
      addPieces(marker, frameOf(marker.header.frame_id), pieces);
    for (const mesh of shapesOf(pieces.shapes.slice(0, MAX_SHAPES))) this.drawn.add(mesh);
    if (pieces.triangles.length > 0) this.drawn.add(trianglesOf(pieces.triangles));
    for (const text of pieces.texts.slice(0, MAX_TEXTS)) this.drawn.add(textSprite(text));
    const lines = pieces.lines.slice(0, MAX_LINES);
    lines.forEach(({ from, to, width, colour }, i) => {
      tint.setRGB(colour[0], colour[1], colour[2], SRGBColorSpace).toArray(linear);
      this.lines.put(i, ...from, ...to, width, linear, colour[3]);
    });
    this.lines.count = lines.length;
    this.lines.send(0, lines.length);
  }

  private clear(): void {
    for (const child of this.drawn.children) {
      const { geometry, material } = child as Mesh<BufferGeometry, MeshLambertMaterial>;
      if (child instanceof Mesh) geometry.dispose();
      material.map?.dispose();
      material.dispose();
    }
    this.drawn.clear();
  }
}

/** One draw call for each kind of shape, and one more for what is clear. */
function shapesOf(shapes: Pieces["shapes"]): InstancedMesh[] {
  const groups = new Map<string, Pieces["shapes"]>();
  for (const piece of shapes) {
    const key = `${piece.shape} ${piece.colour[3] < 0.99}`;
    const group = groups.get(key);
    if (group === undefined) groups.set(key, [piece]);
    else group.push(piece);
  }
  return [...groups.values()].map(instancesOf);
}

const matrix = new Matrix4();
const position = new Vector3();
const turn = new Quaternion();
const size = new Vector3();
const tint = new Color();
const linear: number[] = [];

function instancesOf(group: Pieces["shapes"]): InstancedMesh {
  const { shape, colour } = group[0]!;
  const clear = colour[3] < 0.99;
  const material = new MeshLambertMaterial({
    transparent: clear,
    opacity: clear ? colour[3] : 1,
    depthWrite: !clear,
  });
  const mesh = new InstancedMesh(GEOMETRIES[shape](), material, group.length);
  group.forEach(({ pose, scale, colour: [r, g, b] }, i) => {
    position.fromArray(pose);
    turn.fromArray(pose, 3);
    size.set(...scale);
    mesh.setMatrixAt(i, matrix.compose(position, turn, size));
    mesh.setColorAt(i, tint.setRGB(r, g, b, SRGBColorSpace));
  });
  mesh.frustumCulled = false;
  return mesh;
}

function trianglesOf(triangles: Pieces["triangles"]): Mesh {
  const geometry = new BufferGeometry();
  const corners = Float32Array.from(triangles.flatMap(({ corners }) => corners.flat()));
  const colours = Float32Array.from(
    triangles.flatMap(({ colours }) =>
      colours.flatMap(([r, g, b]) => tint.setRGB(r, g, b, SRGBColorSpace).toArray()),
    ),
  );
  geometry.setAttribute("position", new BufferAttribute(corners, 3));
  geometry.setAttribute("color", new BufferAttribute(colours, 3));
  geometry.computeVertexNormals();
  return new Mesh(geometry, new MeshLambertMaterial({ vertexColors: true, side: 2 }));
}
