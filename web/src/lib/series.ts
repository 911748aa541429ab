/** The newest points of a line, ordered by time, in typed arrays that are written round. */
export class Series {
  private readonly x: Float64Array;
  private readonly y: Float64Array;
  /** Where the oldest point is. */
  private first = 0;
  length = 0;

  constructor(readonly capacity = 100_000) {
    this.x = new Float64Array(capacity);
    this.y = new Float64Array(capacity);
  }

  /** Add a point. Time that goes back (a reset, a seek) drops what is later. */
  push(x: number, y: number): void {
    if (Number.isNaN(x)) return;
    if (this.length > 0 && x < this.lastX) this.length = this.indexOf(x);
    const at = (this.first + this.length) % this.capacity;
    this.x[at] = x;
    this.y[at] = y;
    if (this.length < this.capacity) this.length++;
    else this.first = (this.first + 1) % this.capacity;
  }

  clear(): void {
    this.first = this.length = 0;
  }

  xAt(i: number): number {
    return this.x[(this.first + i) % this.capacity]!;
  }

  yAt(i: number): number {
    return this.y[(this.first + i) % this.capacity]!;
  }

  get lastX(): number {
    return this.length === 0 ? NaN : this.xAt(this.length - 1);
  }

  /** Index of the first point at `x` or later. */
  indexOf(x: number): number {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.xAt(middle) < x) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

/** Columns of a drawing: `x`, and for each line a value or null. */
export type Columns = [Float64Array, ...(number | null)[][]];

/**
 * What of `lines` is seen between two times on `pixels` columns: minimum and maximum of each
 * column, so that no peak is lost however many points there are.
 */
export function columnsOf(
  lines: readonly Series[],
  from: number,
  to: number,
  pixels: number,
): Columns {
  const width = (to - from) / pixels;
  const x = Float64Array.from({ length: 2 * pixels }, (_, i) => from + (i + 0.5) * (width / 2));
  return [x, ...lines.map((line) => extremes(line, from, to, pixels))];
}

function extremes(line: Series, from: number, to: number, pixels: number): (number | null)[] {
  const values = Array.from<number | null>({ length: 2 * pixels }).fill(null);
  const scale = pixels / (to - from);
  for (let i = line.indexOf(from); i < line.length; i++) {
    const column = Math.floor((line.xAt(i) - from) * scale);
    if (column >= pixels) break;
    const y = line.yAt(i);
    if (!Number.isFinite(y)) continue;
    const at = 2 * column;
    const low = values[at] as number | null;
    const high = values[at + 1] as number | null;
    if (low === null || y < low) values[at] = y;
    if (high === null || y > high) values[at + 1] = y;
  }
  return values;
}

/** Lines side by side as CSV, a row for each time; empty where a line has no point. */
export function csvOf(names: readonly string[], lines: readonly Series[]): string {
  const rows = [["time_s", ...names.map(quoted)].join(",")];
  const next = lines.map(() => 0);
  for (;;) {
    const times = lines.map((line, k) => (next[k]! < line.length ? line.xAt(next[k]!) : Infinity));
    const time = Math.min(...times);
    if (time === Infinity) return rows.join("\n") + "\n";
    const cells = lines.map((line, k) => (times[k] === time ? String(line.yAt(next[k]!++)) : ""));
    rows.push([time.toFixed(9).replace(/0+$/, "0"), ...cells].join(","));
  }
}

function quoted(name: string): string {
  return /[",\n]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name;
}
