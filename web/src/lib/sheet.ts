const MIN_PX = 120;
const CLOSING_PX = 70;
const MAX_FRACTION = 0.5;

/** Height of a sheet that is dragged to `height` px on a screen of `screen` px, at most half of it. */
export function sheetOf(height: number, screen: number): { sheet: number; closes: boolean } {
  const max = Math.round(MAX_FRACTION * screen);
  const sheet = Math.min(max, Math.max(Math.min(MIN_PX, max), Math.round(height)));
  return { sheet, closes: height < CLOSING_PX };
}
