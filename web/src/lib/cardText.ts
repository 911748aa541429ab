import { counted } from "./counted.ts";
import { spanText } from "./time.ts";

const WORLDS = { forest: "forest", city: "city", grid_map: "grid map", open: "open ground" };
const SENSORS: Readonly<Record<string, string>> = {
  lidar: "LIDAR",
  camera: "camera",
  sonar: "sonar",
  imu: "IMU",
  gnss: "GNSS",
  barometer: "barometer",
  magnetometer: "magnetometer",
};

interface Contents {
  uavs: number;
  airframes: readonly string[];
  sensors: readonly string[];
  world: keyof typeof WORLDS;
  duration_s: number;
}

/** What is in a scenario, in a few words each: UAVs, sensors, world and duration. */
export function contentsOf(card: Contents): { uavs: string; sensors: string; world: string } {
  const { uavs, airframes, sensors, world, duration_s } = card;
  const named = Object.entries(SENSORS).filter(([kind]) => sensors.includes(kind));
  return {
    uavs: `${counted(uavs, "UAV")}: ${airframes.join(", ")}`,
    sensors: named.map(([, name]) => name).join(", ") || "no sensors",
    world: `${WORLDS[world] ?? world}, ${spanText(duration_s)}`,
  };
}
