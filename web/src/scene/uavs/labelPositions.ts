export interface Box {
  id: number;
  left: number;
  top: number;
  width: number;
  height: number;
  /** The higher wins. */
  rank: number;
}

/** More names than these only hide the scene. */
export const MAX_LABELS = 48;
const GAP_PX = 2;

/** Ids of boxes none of which overlaps another, those of higher rank first. */
export function chooseLabels(boxes: readonly Box[]): number[] {
  const kept: Box[] = [];
  for (const box of [...boxes].sort((a, b) => b.rank - a.rank)) {
    if (kept.length >= MAX_LABELS) break;
    if (!kept.some((other) => overlap(box, other))) kept.push(box);
  }
  return kept.map(({ id }) => id);
}

function overlap(a: Box, b: Box): boolean {
  return (
    a.left < b.left + b.width + GAP_PX &&
    b.left < a.left + a.width + GAP_PX &&
    a.top < b.top + b.height + GAP_PX &&
    b.top < a.top + a.height + GAP_PX
  );
}
