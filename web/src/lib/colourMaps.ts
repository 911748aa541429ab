// Numbers as colours.

/** Red, green, blue, each 0..255. */
export type Colour = [number, number, number];

// Polynomials of Mikhailov's approximation of Turbo (Google AI blog, 2019), for 0..1.
const TURBO = [
  [0.13572138, 4.6153926, -42.66032258, 132.13108234, -152.94239396, 59.28637943],
  [0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604],
  [0.1066733, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973],
] as const;

/** Turbo: blue for 0 over green to red for 1. */
export function turbo(share: number): Colour {
  const x = Math.max(0, Math.min(1, share));
  return TURBO.map((factors) => {
    const value = factors.reduceRight((sum, factor) => sum * x + factor, 0);
    return Math.round(255 * Math.max(0, Math.min(1, value)));
  }) as Colour;
}

const STEPS = 256;

/** Turbo as a table of red, green, blue, alpha. */
export const TURBO_TABLE = new Uint8ClampedArray(STEPS * 4);
for (let i = 0; i < STEPS; i++) TURBO_TABLE.set([...turbo(i / (STEPS - 1)), 255], i * 4);

/** A colour of its own for each label, the same everywhere; 0 and less is dark: nothing there. */
export function labelColour(label: number): Colour {
  if (label <= 0) return [28, 30, 34];
  // Steps of the golden angle keep neighbours' hues apart.
  return ofHue((label * 137.50776405) % 360, 0.62 + 0.28 * ((label * 7) % 3) * 0.5);
}

/** A saturated colour; hue in degrees, value 0..1. */
function ofHue(hue: number, value: number): Colour {
  const channel = (n: number) => {
    const k = (n + hue / 60) % 6;
    return Math.round(255 * value * (1 - 0.72 * Math.max(0, Math.min(k, 4 - k, 1))));
  };
  return [channel(5), channel(3), channel(1)];
}
