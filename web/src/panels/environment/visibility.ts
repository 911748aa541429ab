// Sliders of fog and dust: 0 is clear air, and the farther, the thicker; logarithmic between.

const CLEAREST_M = 5000;
const THICKEST_M = 10;
/** Of the slider: the first step that is fog. */
const FIRST = 1;
const LAST = 100;

/** Meteorological optical range, m; 0: nothing in the air. */
export function visibilityOf(position: number): number {
  if (position < FIRST) return 0;
  const share = (position - FIRST) / (LAST - FIRST);
  return Number((CLEAREST_M * (THICKEST_M / CLEAREST_M) ** share).toPrecision(2));
}

export function positionOfVisibility(visibility: number): number {
  if (visibility <= 0) return 0;
  const share = Math.log(visibility / CLEAREST_M) / Math.log(THICKEST_M / CLEAREST_M);
  return FIRST + (LAST - FIRST) * Math.max(0, Math.min(1, share));
}

export function visibilityText(visibility: number): string {
  if (visibility <= 0) return "none";
  return visibility < 1000 ? `${visibility.toFixed(0)} m` : `${(visibility / 1000).toFixed(1)} km`;
}
