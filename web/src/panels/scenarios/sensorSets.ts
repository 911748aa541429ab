/** Kinds of sensors, as scenarios spell them, by the set that brings them. */
const SETS: Readonly<Record<string, readonly string[]>> = {
  lidar: ["lidar"],
  camera: ["camera"],
  sonar: ["sonar"],
  navigation: ["gnss", "barometer", "magnetometer"],
};

/** The sets that a scenario has already, by the kinds of its sensors. */
export function sensorSetsOf(kinds: readonly string[]): string[] {
  return Object.entries(SETS)
    .filter(([name, own]) => kinds.includes(name) || own.some((kind) => kinds.includes(kind)))
    .map(([name]) => name);
}
