// Light of sun and sky from where the sun stands and what is in the air: pure functions, so that
// an image from a position is the same whenever it is requested. Colours are linear; numbers are
// modelling choices near those of the simulated cameras (`volery.sensors.cameras.light`).

export type Rgb = [number, number, number];

export interface Weather {
  /** Of the sun, rad; azimuth clockwise from north. */
  sunElevation: number;
  sunAzimuth: number;
  /** Meteorological optical range in everything together, m. */
  visibility: number;
  /** That in dust alone, m; 0: none. */
  dustVisibility: number;
  /** mm/h of water. */
  rain: number;
  snow: number;
  /** Mean wind, map, m/s. */
  wind: [number, number, number];
}

export const FAIR: Weather = {
  sunElevation: 0.87,
  sunAzimuth: 2.36,
  visibility: 20_000,
  dustVisibility: 0,
  rain: 0,
  snow: 0,
  wind: [1, 0.5, 0],
};

export interface Daylight {
  /** Unit vector towards what casts shadows: the sun, the moon at night; map. */
  towardsLight: Rgb;
  towardsSun: Rgb;
  /** Of a white surface that faces the sun. */
  sun: Rgb;
  /** Light of the sky from above, and what the ground throws back. */
  above: Rgb;
  below: Rgb;
  zenith: Rgb;
  horizon: Rgb;
  /** What is far away fades into this. */
  haze: Rgb;
  /** 1/m: contrast fades as exp(-extinction distance). */
  extinction: number;
  /** 0 by day, 1 at night. */
  night: number;
  /** 0 clear, 1 nothing but cloud. */
  overcast: number;
}

/** Contrast that is left at the meteorological optical range (WMO-No. 8, ch. 9). */
const CONTRAST_LEFT = 0.05;

/** Koschmieder's law: the extinction at which a contrast has faded to 5 % at the visibility, 1/m. */
export function extinctionOf(visibility: number): number {
  return visibility > 0 ? -Math.log(CONTRAST_LEFT) / visibility : 0;
}

export function daylightOf(weather: Weather): Daylight {
  const { sunElevation, sunAzimuth } = weather;
  const height = Math.sin(sunElevation);
  const towardsSun = direction(sunElevation, sunAzimuth);
  const night = smooth(0.02, -0.16, height);
  const day = 1 - night;
  const overcast = overcastOf(weather);
  const low = smooth(0.35, 0.0, height);
  const warm: Rgb = [1, 1 - 0.38 * low, 1 - 0.72 * low];
  const clear = 1 - 0.9 * overcast;
  const dusk = smooth(-0.12, 0.25, height);
  const sunStrength = 4.4 * smooth(-0.02, 0.22, height) * clear;
  const moonStrength = 0.1 * night * clear;
  const zenith = mix(
    scaled([0.1, 0.23, 0.58], 0.08 + 0.92 * dusk),
    scaled([0.3, 0.33, 0.38], 0.1 + 0.9 * dusk),
    overcast,
  );
  const clearHorizon = mix([0.5, 0.64, 0.82], [0.86, 0.5, 0.3], low * day * 0.8);
  const horizon = mix(
    scaled(clearHorizon, 0.1 + 0.9 * dusk),
    scaled([0.52, 0.55, 0.59], 0.08 + 0.92 * dusk),
    Math.max(overcast, fogginess(weather.visibility)),
  );
  const dark: Rgb = [0.006, 0.009, 0.018];
  const nightZenith = mix(zenith, dark, night);
  const haze = mix(mix(horizon, [0.016, 0.02, 0.032], night), dusty(dusk), dustShare(weather));
  return {
    towardsLight: height > -0.05 ? towardsSun : direction(0.8, sunAzimuth + 2.2),
    towardsSun,
    sun: night < 0.95 ? scaled(warm, sunStrength) : scaled([0.6, 0.75, 1], moonStrength),
    above: scaled(
      mix([0.62, 0.75, 1], [0.85, 0.9, 1], overcast),
      0.09 + 2.2 * dusk * (1 - 0.25 * overcast),
    ),
    below: scaled([0.36, 0.34, 0.28], 0.08 + 1.7 * dusk * (1 - 0.3 * overcast)),
    zenith: nightZenith,
    horizon: haze,
    haze,
    extinction: extinctionOf(weather.visibility),
    night,
    overcast,
  };
}

/** Light rain leaves some blue, moderate rain (2.5 mm/h and more, AMS glossary) hardly any. */
function overcastOf({ rain, snow, visibility }: Weather): number {
  const falling = 1 - Math.exp(-(rain + 2 * snow) / 1.2);
  return Math.max(0.92 * falling, fogginess(visibility));
}

/** 0 in clear air, 1 in fog (visibility below 1 km, WMO). */
function fogginess(visibility: number): number {
  return smooth(4000, 600, visibility);
}

/** How much of what dims the view is dust. */
function dustShare({ dustVisibility, visibility }: Weather): number {
  return dustVisibility > 0 ? Math.min(1, visibility / dustVisibility) : 0;
}

function dusty(dusk: number): Rgb {
  return scaled([0.62, 0.47, 0.28], 0.05 + 0.95 * dusk);
}

/** Unit vector, map: azimuth clockwise from north. */
function direction(elevation: number, azimuth: number): Rgb {
  const level = Math.cos(elevation);
  return [level * Math.sin(azimuth), level * Math.cos(azimuth), Math.sin(elevation)];
}

/** 0 at `from`, 1 at `to`, smooth in between; also downwards. */
export function smooth(from: number, to: number, x: number): number {
  const t = Math.min(1, Math.max(0, (x - from) / (to - from)));
  return t * t * (3 - 2 * t);
}

function scaled(colour: Rgb, by: number): Rgb {
  return [colour[0] * by, colour[1] * by, colour[2] * by];
}

function mix(a: Rgb, b: Rgb, share: number): Rgb {
  return [0, 1, 2].map((i) => a[i]! + share * (b[i]! - a[i]!)) as Rgb;
}
