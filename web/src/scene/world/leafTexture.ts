import { CanvasTexture, LinearMipmapLinearFilter, SRGBColorSpace } from "three";
import { randoms } from "./noiseTexture.ts";

const SIDE = 128;
const LEAVES = 90;

/** A twig's leaves on nothing: what each triangle of a crown is cut out by. */
export function makeLeaves(): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIDE;
  const context = canvas.getContext("2d");
  if (context !== null) drawLeaves(context);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.minFilter = LinearMipmapLinearFilter;
  return texture;
}

function drawLeaves(context: CanvasRenderingContext2D): void {
  const random = randoms(11);
  context.fillStyle = "rgba(140,150,120,0)";
  for (let i = 0; i < LEAVES; i++) {
    const [x, y] = inTriangle(random);
    const grey = 165 + 90 * random();
    context.fillStyle = `rgb(${grey * 0.95},${grey},${grey * 0.85})`;
    context.save();
    context.translate(x * SIDE, (1 - y) * SIDE);
    context.rotate(6.283 * random());
    context.beginPath();
    context.ellipse(0, 0, 0.085 * SIDE, 0.038 * SIDE, 0, 0, 6.283);
    context.fill();
    context.restore();
  }
}

/** Somewhere in the triangle (0, 0) (1, 0) (.5, 1), away from its edges. */
function inTriangle(random: () => number): [number, number] {
  let a = random();
  let b = random();
  if (a + b > 1) [a, b] = [1 - a, 1 - b];
  return [0.5 + 0.88 * (a + 0.5 * b - 0.5), 0.08 + 0.8 * b];
}
