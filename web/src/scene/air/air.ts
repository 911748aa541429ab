import { Color, Vector3 } from "three";
import { link } from "../../link/link.ts";
import type { volery_interfaces_Weather } from "../../messages/generated.ts";
import { daylightOf, FAIR, type Daylight, type Rgb, type Weather } from "./daylight.ts";

/** A change of weather is seen within this time, s. */
const CHANGE_S = 0.12;

/** The air of the scene: what the newest weather says, reached in a moment and not at once. */
export class Air {
  /** As shown now. */
  light: Daylight = daylightOf(FAIR);
  weather: Weather = FAIR;
  /** Grows when the light has changed. */
  version = 0;
  readonly haze = new Color();
  readonly towardsLight = new Vector3();

  private wanted: Weather = FAIR;
  private readonly end: () => void;

  constructor() {
    this.end = link.subscribe("/weather", "volery_interfaces/msg/Weather", ({ message }) => {
      this.wanted = weatherOf(message);
    });
    this.relight();
  }

  update(stepS: number): void {
    if (this.weather === this.wanted) return;
    const share = 1 - Math.exp(-stepS / CHANGE_S);
    this.weather = near(this.weather, this.wanted)
      ? this.wanted
      : between(this.weather, this.wanted, share);
    this.relight();
  }

  dispose(): void {
    this.end();
  }

  private relight(): void {
    this.light = daylightOf(this.weather);
    this.haze.setRGB(...this.light.haze);
    this.towardsLight.set(...this.light.towardsLight);
    this.version++;
  }
}

export function weatherOf(message: volery_interfaces_Weather): Weather {
  const { wind } = message;
  return {
    sunElevation: orElse(message.sun_elevation, FAIR.sunElevation),
    sunAzimuth: orElse(message.sun_azimuth, FAIR.sunAzimuth),
    visibility: message.visibility > 0 ? message.visibility : FAIR.visibility,
    dustVisibility: orElse(message.dust_visibility, 0),
    rain: orElse(message.rain, 0),
    snow: orElse(message.snow, 0),
    wind: [orElse(wind?.x, 0), orElse(wind?.y, 0), orElse(wind?.z, 0)],
  };
}

function orElse(number: number | null | undefined, otherwise: number): number {
  return typeof number === "number" && Number.isFinite(number) ? number : otherwise;
}

function near(a: Weather, b: Weather): boolean {
  const close = (x: number, y: number) => Math.abs(x - y) < 1e-3 * (Math.abs(y) + 0.01);
  return (
    close(a.sunElevation, b.sunElevation) &&
    close(a.sunAzimuth, b.sunAzimuth) &&
    close(a.visibility, b.visibility) &&
    close(a.rain, b.rain) &&
    close(a.snow, b.snow) &&
    a.wind.every((v, i) => close(v, b.wind[i]!))
  );
}

/** Visibilities change by their inverses, which add up. */
function between(a: Weather, b: Weather, share: number): Weather {
  const mixed = (x: number, y: number) => x + share * (y - x);
  const inverse = (x: number, y: number) => {
    const sum = mixed(x > 0 ? 1 / x : 0, y > 0 ? 1 / y : 0);
    return sum > 1e-7 ? 1 / sum : 0;
  };
  return {
    sunElevation: mixed(a.sunElevation, b.sunElevation),
    sunAzimuth: mixed(a.sunAzimuth, b.sunAzimuth),
    visibility: inverse(a.visibility, b.visibility),
    dustVisibility: inverse(a.dustVisibility, b.dustVisibility),
    rain: mixed(a.rain, b.rain),
    snow: mixed(a.snow, b.snow),
    wind: a.wind.map((v, i) => mixed(v, b.wind[i]!)) as Rgb,
  };
}
