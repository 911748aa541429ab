// Weather, the hour of day and maps of blocks.

import type {
  volery_interfaces_GetGridMap_Response,
  volery_interfaces_GetWeather_Response,
} from "../../messages/generated.ts";
import { order } from "./requests.ts";

/** What of the weather can be set; see `volery_interfaces/srv/SetWeather` for units. */
export interface Weather {
  wind: { x: number; y: number; z: number };
  w20: number;
  rain: number;
  snow: number;
  fog_visibility: number;
  dust_visibility: number;
  hour_of_day: number;
}

export type WeatherKey = keyof Weather;

/** Set these; all else stays as it is. */
export async function setWeather(changes: Partial<Weather>): Promise<void> {
  const only = Object.keys(changes);
  const type = "volery_interfaces/srv/SetWeather";
  await order("/volery/set_weather", type, { only, ...changes });
}

/** No wind, nothing in the air; the sun stays. */
export async function clearWeather(): Promise<void> {
  const zero = { wind: { x: 0, y: 0, z: 0 }, w20: 0, rain: 0, snow: 0 };
  await setWeather({ ...zero, fog_visibility: 0, dust_visibility: 0 });
}

export async function getWeather(): Promise<volery_interfaces_GetWeather_Response> {
  return await order("/volery/get_weather", "volery_interfaces/srv/GetWeather", {});
}

/** A gust on top of the wind: m/s in the map, s. */
export async function blowGust(
  amplitude: { x: number; y: number; z: number },
  rise: number,
  duration: number,
): Promise<void> {
  const type = "volery_interfaces/srv/Gust";
  await order("/volery/gust", type, { amplitude, rise, duration });
}

export type GridMap = volery_interfaces_GetGridMap_Response;

/** Rejects in a world without blocks. */
export async function gridMap(): Promise<GridMap> {
  return await order("/volery/get_grid_map", "volery_interfaces/srv/GetGridMap", {});
}

/** Empty and 0 leave it as it is. */
export async function setGridMap(change: {
  name?: string;
  block_height?: number;
  cell_size?: number;
}): Promise<void> {
  const type = "volery_interfaces/srv/SetGridMap";
  await order("/volery/set_grid_map", type, { name: "", ...change }, 60);
}
