// The world from above as an image that the map draws each time.

import type { Heights } from "../../lib/heights.ts";
import type { WorldPlan } from "../../state/worldPlan.ts";

export interface PlanImage {
  image: HTMLCanvasElement;
  /** Edges in the map, m. */
  left: number;
  right: number;
  bottom: number;
  top: number;
}

export interface PlanColours {
  ground: [number, number, number];
  crown: string;
  trunk: string;
  roof: string;
  edge: string;
}

const MAX_PIXELS = 2048;
const FINEST_PIXELS_A_METRE = 8;
const MARGIN_M = 2;

/** Null where there is nothing to be seen. */
export function drawPlan(plan: WorldPlan, colours: PlanColours): PlanImage | null {
  const box = boxOf(plan);
  if (box === null) return null;
  const side = Math.max(box.right - box.left, box.top - box.bottom);
  const scale = Math.min(FINEST_PIXELS_A_METRE, MAX_PIXELS / side);
  const image = document.createElement("canvas");
  image.width = Math.max(1, Math.round((box.right - box.left) * scale));
  image.height = Math.max(1, Math.round((box.top - box.bottom) * scale));
  const context = image.getContext("2d")!;
  // From here on one unit is a metre, east to the right and north up.
  context.setTransform(scale, 0, 0, -scale, -box.left * scale, box.top * scale);
  if (plan.ground !== null) drawGround(context, plan.ground, colours.ground);
  drawTrees(context, plan, colours);
  drawRoofs(context, plan.roofs, colours, scale);
  return { image, ...box };
}

function boxOf({ ground, trees, roofs }: WorldPlan) {
  let [left, right, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
  const include = (x: number, y: number, margin: number) => {
    left = Math.min(left, x - margin);
    right = Math.max(right, x + margin);
    bottom = Math.min(bottom, y - margin);
    top = Math.max(top, y + margin);
  };
  if (ground !== null) {
    const { x, y, cell, columns, rows } = ground;
    include(x, y, 0);
    include(x + columns * cell, y + rows * cell, 0);
  }
  for (const { x, y, crown } of trees) include(x, y, crown);
  for (let i = 0; i < roofs.length; i += 3) include(roofs[i]!, roofs[i + 1]!, MARGIN_M);
  return left < right && bottom < top ? { left, right, bottom, top } : null;
}

/** Shaded as by a lamp in the north-west, which is how maps are read. */
function drawGround(
  context: CanvasRenderingContext2D,
  ground: Heights,
  colour: [number, number, number],
): void {
  const { columns, rows, cell, x, y, z } = ground;
  const shade = document.createElement("canvas");
  shade.width = columns;
  shade.height = rows;
  const pixels = shade.getContext("2d")!;
  const data = pixels.createImageData(columns, rows);
  const at = (column: number, row: number) =>
    z[Math.max(0, Math.min(rows - 1, row)) * columns + Math.max(0, Math.min(columns - 1, column))]!;
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      const height = at(column, row);
      const east = (at(column + 1, row) - at(column - 1, row)) / (2 * cell) || 0;
      const north = (at(column, row + 1) - at(column, row - 1)) / (2 * cell) || 0;
      // Cosine between the normal (-east, -north, 1) and the light, 45 degrees high.
      const light = (east - north + Math.SQRT2) / (2 * Math.hypot(east, north, 1));
      const brightness = 0.45 + 0.78 * Math.max(0, light);
      const to = ((rows - 1 - row) * columns + column) * 4;
      colour.forEach((channel, k) => (data.data[to + k] = channel * brightness));
      data.data[to + 3] = Number.isNaN(height) ? 0 : 255;
    }
  }
  pixels.putImageData(data, 0, 0);
  context.save();
  context.translate(x, y + rows * cell);
  context.scale(1, -1);
  context.drawImage(shade, 0, 0, columns * cell, rows * cell);
  context.restore();
}

function drawTrees(
  context: CanvasRenderingContext2D,
  { trees }: WorldPlan,
  colours: PlanColours,
): void {
  disks(context, colours.crown, trees, ({ crown }) => crown, 0.55);
  disks(context, colours.trunk, trees, ({ trunk }) => Math.max(trunk, trunk > 0 ? 0.25 : 0), 1);
}

function disks<T extends { x: number; y: number }>(
  context: CanvasRenderingContext2D,
  colour: string,
  items: readonly T[],
  radius: (item: T) => number,
  alpha: number,
): void {
  context.globalAlpha = alpha;
  context.fillStyle = colour;
  context.beginPath();
  for (const item of items) {
    const r = radius(item);
    if (r <= 0) continue;
    context.moveTo(item.x + r, item.y);
    context.arc(item.x, item.y, r, 0, 2 * Math.PI);
  }
  context.fill();
  context.globalAlpha = 1;
}

function drawRoofs(
  context: CanvasRenderingContext2D,
  roofs: Float32Array,
  colours: PlanColours,
  scale: number,
): void {
  context.beginPath();
  for (let i = 0; i + 9 <= roofs.length; i += 9) {
    context.moveTo(roofs[i]!, roofs[i + 1]!);
    context.lineTo(roofs[i + 3]!, roofs[i + 4]!);
    context.lineTo(roofs[i + 6]!, roofs[i + 7]!);
    context.closePath();
  }
  context.fillStyle = context.strokeStyle = colours.roof;
  context.lineWidth = 1 / scale; // closes the hair between neighbours
  context.fill();
  context.stroke();
}
