// What an artificial horizon and a tape of altitudes show.

const DEG = 180 / Math.PI;

/** Units of the drawing for a degree of pitch. */
export const PITCH_SCALE = 1.4;

/** Units of the drawing for a mark of the tape. */
export const MARK_GAP = 14;

/**
 * SVG transform of a horizon, level at first; `roll` and `pitch` in rad, of a body FLU in ENU
 * (REP-103): right side down and nose down are positive.
 */
export function horizonTransform(roll: number, pitch: number): string {
  return `rotate(${fixed(-roll * DEG)}) translate(0 ${fixed(-pitch * DEG * PITCH_SCALE)})`;
}

/** Metres between two marks of a tape: fewer the higher it is. */
export function markSpacing(altitude: number): number {
  const high = Math.abs(altitude);
  return high < 20 ? 1 : high < 200 ? 5 : 20;
}

export interface Mark {
  /** Altitude that it names, m. */
  value: number;
  /** Where it stands, from the middle of the tape down. */
  y: number;
}

/** Marks around an altitude, the lowest first. */
export function tapeMarks(altitude: number, count: number): Mark[] {
  const spacing = markSpacing(altitude);
  const first = Math.round(altitude / spacing) - Math.floor(count / 2);
  return Array.from({ length: count }, (_, i) => {
    const value = (first + i) * spacing;
    return { value, y: (MARK_GAP * (altitude - value)) / spacing };
  });
}

/** Without -0, which SVG would show and tests would trip over. */
function fixed(value: number): string {
  const text = value.toFixed(2);
  return text === "-0.00" ? "0.00" : text;
}
