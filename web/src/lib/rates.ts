/** How often something comes, told by its own stamps, so that speed and throttling do not count. */
export class RateMeter {
  private stamps: number[] = [];

  constructor(private readonly most = 20) {}

  /** A message with this stamp, s, has come. */
  add(stampS: number): void {
    const last = this.stamps.at(-1);
    if (last !== undefined && stampS < last) this.stamps = []; // a reset
    if (stampS === last) return;
    this.stamps.push(stampS);
    if (this.stamps.length > this.most) this.stamps.shift();
  }

  /** Hz of the stamps' time; NaN before there are two. */
  get hz(): number {
    const { stamps } = this;
    if (stamps.length < 2) return NaN;
    return (stamps.length - 1) / (stamps.at(-1)! - stamps[0]!);
  }
}

export function rateText(hz: number): string {
  if (Number.isNaN(hz)) return "–";
  return `${hz >= 9.95 ? hz.toFixed(0) : hz.toFixed(1)} Hz`;
}
