// OctoMap's streams of bits: A. Hornung et al., "OctoMap", Autonomous Robots 2013; the format is that
// of `octomap::OcTree::writeBinaryData` and `writeData`.

/** Levels of the tree: cubes of the finest are `resolution` wide. */
const DEPTH = 16;
/** A ColorOcTree's nodes have red, green and blue besides. */
const COLOUR_BYTES = 3;

export interface Voxels {
  /** x y z of the middle and half the side, four numbers each, m. */
  cubes: Float32Array;
  count: number;
}

/** Occupied cubes of a map; `maxCubes` of them at most. */
export function occupiedCubes(
  data: Uint8Array,
  resolution: number,
  binary: boolean,
  maxCubes: number,
  coloured = false,
): Voxels {
  const cubes = new Float32Array(4 * maxCubes);
  if (!(resolution > 0) || data.length === 0) return { cubes, count: 0 };
  const reader = new Reader(data, resolution, cubes, maxCubes, coloured ? COLOUR_BYTES : 0);
  if (binary) reader.binaryNode(0, 0, 0, DEPTH);
  else reader.fullNode(0, 0, 0, DEPTH);
  return { cubes, count: reader.count };
}

class Reader {
  count = 0;
  private at = 0;
  private readonly view: DataView;

  constructor(
    private readonly data: Uint8Array,
    private readonly resolution: number,
    private readonly cubes: Float32Array,
    private readonly maxCubes: number,
    private readonly extraBytes: number,
  ) {
    this.view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  }

  /** Two bits a child, the first child's lowest: 0 unknown, 1 free, 2 occupied, 3 has children. */
  binaryNode(x: number, y: number, z: number, depth: number): void {
    if (this.at + 2 > this.data.length || depth <= 0) return;
    const bits = this.data[this.at]! | (this.data[this.at + 1]! << 8);
    this.at += 2;
    const kind = (child: number) => (bits >> (2 * child)) & 3;
    for (let child = 0; child < 8; child++) if (kind(child) === 2) this.add(x, y, z, depth, child);
    for (let child = 0; child < 8; child++)
      if (kind(child) === 3) this.binaryNode(...this.middle(x, y, z, depth, child), depth - 1);
  }

  /** A log-odds (float32) and perhaps a colour, then a byte of which children follow. */
  fullNode(x: number, y: number, z: number, depth: number): void {
    const bytes = 5 + this.extraBytes;
    if (this.at + bytes > this.data.length || depth < 0) return;
    const logOdds = this.view.getFloat32(this.at, true);
    const children = this.data[this.at + bytes - 1]!;
    this.at += bytes;
    if (children === 0) {
      if (logOdds > 0) this.put(x, y, z, this.side(depth));
      return;
    }
    for (let child = 0; child < 8; child++)
      if ((children >> child) & 1) this.fullNode(...this.middle(x, y, z, depth, child), depth - 1);
  }

  /** Side of a cube that has so many levels below it. */
  private side(depth: number): number {
    return this.resolution * 2 ** depth;
  }

  private middle(
    x: number,
    y: number,
    z: number,
    depth: number,
    child: number,
  ): [number, number, number] {
    const quarter = 0.25 * this.side(depth);
    const sign = (bit: number) => ((child >> bit) & 1 ? quarter : -quarter);
    return [x + sign(0), y + sign(1), z + sign(2)];
  }

  private add(x: number, y: number, z: number, depth: number, child: number): void {
    this.put(...this.middle(x, y, z, depth, child), this.side(depth - 1));
  }

  private put(x: number, y: number, z: number, side: number): void {
    if (this.count >= this.maxCubes) return;
    this.cubes.set([x, y, z, 0.5 * side], 4 * this.count++);
  }
}
