/** What came in the last seconds of wall time: messages and bytes. */
export class TrafficMeter {
  private readonly times: number[] = [];
  private readonly sizes: number[] = [];
  private bytes = 0;
  private startedMs = NaN;

  constructor(private readonly windowMs = 3000) {}

  add(nowMs: number, bytes: number): void {
    if (Number.isNaN(this.startedMs)) this.startedMs = nowMs;
    this.times.push(nowMs);
    this.sizes.push(bytes);
    this.bytes += bytes;
    this.forget(nowMs);
  }

  /** Messages/s, bytes/s and mean bytes a message of the window that ends now; NaN: none came. */
  read(nowMs: number): { hz: number; bytesPerS: number; bytes: number } {
    this.forget(nowMs);
    const count = this.times.length;
    const span = Math.min(this.windowMs, nowMs - this.startedMs) / 1000;
    if (count === 0) return { hz: 0, bytesPerS: 0, bytes: NaN };
    // The first message of a short window began it: the gaps count, not the posts.
    const gaps = span * 1000 < this.windowMs ? count - 1 : count;
    const seconds = Math.max(span, 1e-3);
    return { hz: gaps / seconds, bytesPerS: this.bytes / seconds, bytes: this.bytes / count };
  }

  private forget(nowMs: number): void {
    let old = 0;
    while (old < this.times.length && this.times[old]! <= nowMs - this.windowMs) {
      this.bytes -= this.sizes[old]!;
      old++;
    }
    this.times.splice(0, old);
    this.sizes.splice(0, old);
  }
}

const PREFIXES = ["", "k", "M", "G", "T"];

/** `1234` as `1.23 kB`. */
export function bytesText(bytes: number): string {
  if (!Number.isFinite(bytes)) return "–";
  let power = 0;
  let value = bytes;
  while (value >= 999.5 && power < PREFIXES.length - 1) {
    value /= 1000;
    power++;
  }
  const digits = power === 0 || value >= 99.95 ? 0 : value >= 9.995 ? 1 : 2;
  return `${value.toFixed(digits)} ${PREFIXES[power]}B`;
}
