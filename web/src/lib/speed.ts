// The speed slider: logarithmic from 0.1 to 10 times real time, and at its end "as fast as possible".

const MIN_SPEED = 0.1;
const MAX_SPEED = 10;
/** Of the slider: where 10 x stands, and its end. */
const TEN = 100;
export const END = 112;
/** So near a mark the slider is on it. */
const CATCH = 1.6;

/** As fast as possible, in the services' words. */
export const UNBOUNDED = 0;
export const SPEED_MARKS = [0.1, 0.25, 0.5, 1, 2, 5, 10, UNBOUNDED];

export function positionOf(speed: number): number {
  if (speed <= 0) return END;
  const clipped = Math.max(MIN_SPEED, Math.min(MAX_SPEED, speed));
  return (TEN * Math.log(clipped / MIN_SPEED)) / Math.log(MAX_SPEED / MIN_SPEED);
}

export function speedOf(position: number): number {
  const mark = SPEED_MARKS.find((speed) => Math.abs(positionOf(speed) - position) <= CATCH);
  if (mark !== undefined) return mark;
  if (position > (TEN + END) / 2) return UNBOUNDED;
  const speed = MIN_SPEED * (MAX_SPEED / MIN_SPEED) ** (Math.min(TEN, position) / TEN);
  return Number(speed.toPrecision(2));
}

export function speedText(speed: number): string {
  return speed <= 0 ? "max" : `${Number(speed.toPrecision(2))} ×`;
}

/** The next mark up or down. */
export function nextMark(speed: number, up: boolean): number {
  const here = positionOf(speed);
  const marks = SPEED_MARKS.map(positionOf);
  const next = up ? marks.find((m) => m > here + 0.1) : marks.findLast((m) => m < here - 0.1);
  return next === undefined ? speed : speedOf(next);
}
