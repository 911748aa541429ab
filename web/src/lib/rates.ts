/** How often something comes, by its own stamps, so that speed and throttling do not count. */
export class RateMeter {
  private stamps: number[] = [];

  constructor(private readonly maxSamples = 20) {}

  /** A message with this stamp, s, has come. */
  add(stampS: number): void {
    const last = this.stamps.at(-1);
    if (last !== undefined && stampS < last) this.stamps = []; // a reset
    if (stampS === last) return;
    this.stamps.push(stampS);
    if (this.stamps.length > this.maxSamples) this.stamps.shift();
  }

  /** Hz of the stamps' time; NaN before there are two. */
  get hz(): number {
    const { stamps } = this;
    if (stamps.length < 2) return NaN;
    return (stamps.length - 1) / (stamps.at(-1)! - stamps[0]!);
  }
}

/** How often something comes in wall time; it falls while nothing comes. */
export class ArrivalMeter {
  private arrivals: number[] = [];

  constructor(private readonly maxSamples = 20) {}

  /** Something has come at this wall time, s. */
  add(wallS: number): void {
    this.arrivals.push(wallS);
    if (this.arrivals.length > this.maxSamples) this.arrivals.shift();
  }

  /** Hz at this wall time, s; NaN before there are two. */
  hzAt(nowS: number): number {
    const { arrivals } = this;
    if (arrivals.length < 2) return NaN;
    const intervals = arrivals.length - 1;
    const span = arrivals.at(-1)! - arrivals[0]!;
    const waited = nowS - arrivals.at(-1)!;
    return intervals / (span + (waited > (2 * span) / intervals ? waited : 0));
  }
}

/** Rates that differ by less are shown as one. */
const SAME = 0.2;

/** The rate in simulated time, and the one in wall time where it differs. */
export function ratesText(wallHz: number, simulatedHz: number): string {
  const differ = Math.abs(wallHz - simulatedHz) > SAME * simulatedHz;
  const simulated = rateText(simulatedHz);
  return differ ? `${simulated} simulated, ${rateText(wallHz)} real` : simulated;
}

export function rateText(hz: number): string {
  if (Number.isNaN(hz)) return "–";
  return `${hz >= 9.95 ? hz.toFixed(0) : hz.toFixed(1)} Hz`;
}
