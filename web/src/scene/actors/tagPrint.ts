// The print of an AprilTag: from an actor's tags (simulation_interfaces) to boards and black cells.
// As in `volery.world.actors.tags`: x to the top of the image, y to its left, z out of it.

const CELLS = 8;
const CODE_CELLS = 6;

export interface TagPrint {
  /** 36 bits as nine hexadecimal digits, row by row from the top left, 1 for white. */
  readonly code: string;
  /** Outer side of the black border. */
  readonly sizeM: number;
}

/** A square or a run of cells: its middle and its extent along x and y, metres. */
export interface Plate {
  readonly x: number;
  readonly y: number;
  readonly along: number;
  readonly across: number;
}

export function printOf(tags: readonly string[]): TagPrint | null {
  const value = (key: string) => tags.find((tag) => tag.startsWith(`${key}=`))?.split("=")[1];
  const code = value("code");
  const sizeM = Number(value("size_m"));
  if (code === undefined || !/^[0-9a-f]{9}$/.test(code) || !(sizeM > 0)) return null;
  return { code, sizeM };
}

export function isBlack({ code }: TagPrint, row: number, column: number): boolean {
  const i = row - 1;
  const j = column - 1;
  if (i < 0 || j < 0 || i >= CODE_CELLS || j >= CODE_CELLS) return true;
  const bit = i * CODE_CELLS + j;
  return ((parseInt(code[bit >> 2]!, 16) >> (3 - (bit & 3))) & 1) === 0;
}

/** The runs of black cells of each row. */
export function blackPlates(print: TagPrint): Plate[] {
  const cell = print.sizeM / CELLS;
  const plates: Plate[] = [];
  for (let row = 0; row < CELLS; row++) {
    let first = 0;
    for (let column = 0; column <= CELLS; column++) {
      if (column < CELLS && isBlack(print, row, column)) continue;
      if (column > first)
        plates.push({
          x: (CELLS / 2 - row - 0.5) * cell,
          y: (CELLS / 2 - (first + column) / 2) * cell,
          along: cell,
          across: (column - first) * cell,
        });
      first = column + 1;
    }
  }
  return plates;
}

export function boardSide(print: TagPrint): number {
  return (print.sizeM * (CELLS + 2)) / CELLS;
}
