/** The minimum span of an axis by what is plotted, so that noise does not look like motion. */
const SPANS: readonly (readonly [RegExp, number])[] = [
  [/latitude|longitude/, 2e-5], // degrees: about 2 m
  [/covariance/, 1e-6],
  [/orientation|quaternion|rotation/, 0.1],
  [/angular|rate|omega/, 0.2], // rad/s
  [/acceleration/, 1], // m/s2
  [/velocity|twist|linear|speed/, 0.5], // m/s
  [/position|translation|point|altitude|height|range/, 0.5], // m
  [/voltage/, 0.5], // V
  [/percentage|battery|fraction/, 0.05],
  [/pressure/, 20], // Pa
  [/temperature/, 1], // K
  [/magnetic/, 5e-6], // T
];
/** Of the largest value, for quantities that are not known. */
const MIN_FRACTION = 0.01;

/** Minimum span of a line by the path of its field: the innermost name that is known; NaN: none is. */
export function minSpanOf(path: string): number {
  for (const part of path.toLowerCase().split(".").reverse()) {
    const known = SPANS.find(([pattern]) => pattern.test(part));
    if (known !== undefined) return known[1];
  }
  return NaN;
}

/** The range of an axis for values between `min` and `max`: around them, and `minSpan` at least. */
export function widened(min: number, max: number, minSpan: number): [number, number] {
  const magnitude = Math.max(Math.abs(min), Math.abs(max));
  const span = Number.isNaN(minSpan) ? MIN_FRACTION * magnitude : minSpan;
  const missing = Math.max(0, span - (max - min));
  return [min - missing / 2, max + missing / 2];
}
