import { Color, SRGBColorSpace } from "three";

/** Colours of the UAVs' trails and paths, linear; neighbours in the list differ most. */
const HUES = [0.53, 0.08, 0.33, 0.86, 0.14, 0.6, 0.95, 0.42, 0.72, 0.0];

export function colourOf(number: number): [number, number, number] {
  const { r, g, b } = new Color().setHSL(HUES[number % HUES.length]!, 0.85, 0.56);
  return [r, g, b];
}

/** An sRGB colour of bytes as the scene takes it. */
export function linearOf([r, g, b]: readonly [number, number, number]): [number, number, number] {
  const colour = new Color().setRGB(r / 255, g / 255, b / 255, SRGBColorSpace);
  return [colour.r, colour.g, colour.b];
}

export const SELECTED: readonly [number, number, number] = [0.05, 0.85, 1];
export const CRASHED: readonly [number, number, number] = [0.95, 0.06, 0.03];
