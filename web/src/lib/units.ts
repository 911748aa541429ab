// Units of fields by their names, as REP-103 and the definitions of the common messages have them.

const XYZ = String.raw`\.[xyz]`;
/** By the end of a field's path, and by its type where the path says too little. */
const UNITS: readonly (readonly [RegExp, string])[] = [
  [new RegExp(`(^|\\.)(position|translation|point|points\\[\\d+\\])${XYZ}$`), "m"],
  [/(^|\.)(altitude|range|(min_|max_)range|range_(min|max)|ranges\[\d+\])$/, "m"],
  [new RegExp(`(^|\\.)linear_acceleration${XYZ}$`), "m/s²"],
  [new RegExp(`(^|\\.)accel(\\.accel)?\\.linear${XYZ}$`), "m/s²"],
  [new RegExp(`(^|\\.)accel(\\.accel)?\\.angular${XYZ}$`), "rad/s²"],
  [new RegExp(`(^|\\.)(angular_velocity|angular)${XYZ}$`), "rad/s"],
  [new RegExp(`(^|\\.)(velocity|linear)${XYZ}$`), "m/s"],
  [/(^|\.)(latitude|longitude)$/, "°"],
  [/(^|\.)voltage$/, "V"],
  [/(^|\.)fluid_pressure$/, "Pa"],
  [/(^|\.)temperature$/, "°C"],
  [new RegExp(`(^|\\.)magnetic_field${XYZ}$`), "T"],
  [/_m_s$/, "m/s"],
  [/_rad_s$/, "rad/s"],
  [/_hz$/, "Hz"],
  [/_deg$/, "°"],
  [/_m$/, "m"],
  [/_s$/, "s"],
];

/** Names on an axis, at most. */
const MAX_NAMES = 3;

/** Unit of a field; empty: not known. */
export function unitOf(path: string, type = ""): string {
  const within = /\/Accel[A-Za-z]*$/.test(type) && !/(^|\.)accel\./.test(path) ? "accel." : "";
  return UNITS.find(([pattern]) => pattern.test(within + path))?.[1] ?? "";
}

/** Whether a field is a length, so that one scale fits it and another one. */
export function isLength(path: string, type = ""): boolean {
  return unitOf(path, type) === "m";
}

/** What an axis shows: `position.x, m`; of several numbers their last names: `x; y, m`. */
export function axisText(lines: readonly { path: string; type: string }[]): string {
  const units = new Set(lines.map(({ path, type }) => unitOf(path, type)));
  const paths = [...new Set(lines.map(({ path }) => shortOf(path)))];
  const names = paths.length > 1 ? paths.map((path) => path.split(".").at(-1)!) : paths;
  const [unit = ""] = units;
  const text = [...new Set(names)].slice(0, MAX_NAMES).join("; ");
  return units.size === 1 && unit !== "" ? `${text}, ${unit}` : text;
}

/** The last two names of a path. */
export function shortOf(path: string): string {
  return path.split(".").slice(-2).join(".");
}
