import { CanvasTexture, Sprite, SpriteMaterial } from "three";
import type { Pieces } from "./pieces.ts";

const LINE_PX = 48;
const WIDEST_PX = 1024;

/** A text that faces the camera; `height` is that of a line, m. */
export function textSprite({ at, text, height, colour }: Pieces["texts"][number]): Sprite {
  const lines = text.split("\n").slice(0, 12);
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("2d");
  const font = `600 ${0.75 * LINE_PX}px Inter, system-ui, sans-serif`;
  let width = LINE_PX;
  if (context !== null) {
    context.font = font;
    width = Math.min(
      WIDEST_PX,
      Math.max(...lines.map((line) => context.measureText(line).width)) + 16,
    );
  }
  canvas.width = Math.ceil(width);
  canvas.height = LINE_PX * lines.length;
  if (context !== null) {
    const [r, g, b, a] = colour;
    context.font = font; // a canvas of another size has forgotten it
    context.textBaseline = "middle";
    context.fillStyle = `rgba(${255 * r}, ${255 * g}, ${255 * b}, ${a})`;
    lines.forEach((line, i) => context.fillText(line, 8, LINE_PX * (i + 0.5), width - 16));
  }
  const sprite = new Sprite(
    new SpriteMaterial({ map: new CanvasTexture(canvas), depthWrite: false }),
  );
  const tall = height > 0 ? height : 0.3;
  sprite.scale.set((tall * canvas.width) / LINE_PX, tall * lines.length, 1);
  sprite.position.set(...at);
  return sprite;
}
