// The sliders of the weather's fields, section by section.

import type { WeatherKey } from "../../link/commands.ts";
import { hourText } from "../../lib/time.ts";
import type { DialField } from "./FieldDials.tsx";
import { positionOfVisibility, visibilityOf, visibilityText } from "./visibility.ts";

export type WeatherNumber = Exclude<WeatherKey, "wind">;
type Field = DialField<WeatherNumber>;

export const LIGHT: readonly Field[] = [
  {
    key: "hour_of_day",
    name: "Hour of day",
    min: 0.25,
    max: 24,
    step: 0.25,
    text: (hour) => (hour === 0 ? "from the scenario" : hourText(hour)),
  },
];

export const TURBULENCE: readonly Field[] = [
  {
    key: "w20",
    name: "Turbulence",
    min: 0,
    max: 25,
    step: 0.5,
    text: (w20) => (w20 === 0 ? "none" : `mean wind ${w20.toFixed(1)} m/s at 6 m`),
  },
];

export const PRECIPITATION: readonly Field[] = [
  {
    key: "rain",
    name: "Rain",
    min: 0,
    max: 100,
    step: 1,
    text: (rain) => (rain === 0 ? "none" : `${rain.toFixed(0)} mm/h`),
  },
  {
    key: "snow",
    name: "Snow",
    min: 0,
    max: 20,
    step: 0.5,
    text: (snow) => (snow === 0 ? "none" : `${snow.toFixed(1)} mm/h water equivalent`),
  },
];

export const VISIBILITY: readonly Field[] = [
  { key: "fog_visibility", name: "Fog", ...visibilityDial() },
  { key: "dust_visibility", name: "Dust", ...visibilityDial() },
];

function visibilityDial(): Omit<Field, "key" | "name"> {
  return {
    min: 0,
    max: 100,
    step: 1,
    text: (position) => visibilityText(visibilityOf(position)),
    scale: { positionOf: positionOfVisibility, valueOf: visibilityOf },
  };
}
