import type { UploadKind } from "../link/commands/scenarios.ts";
import { ownEntry } from "./ownEntry.ts";

/** What can be uploaded: what scenarios are made of, and logs. */
export type FileKind = UploadKind | "log";

const BY_ENDING: Readonly<Record<string, FileKind>> = {
  png: "grid_map",
  yaml: "grid_map",
  yml: "grid_map",
  pgm: "grid_map",
  map: "grid_map",
  txt: "grid_map",
  geojson: "city",
  json: "city",
  geojsonl: "city",
  geojsons: "city",
  glb: "mesh",
  gltf: "mesh",
  obj: "mesh",
  stl: "mesh",
  toml: "scenario",
  mcap: "log",
  bag: "log",
};

export const ENDINGS = [...Object.keys(BY_ENDING), "csv"].map((ending) => `.${ending}`).join(",");

/** What to choose, for a first visit. */
export const UPLOAD_HINT =
  "a map (grid, .yaml with its image, GeoJSON, glTF, OBJ, STL, tree inventory), a scenario (TOML) or a log (MCAP, bag)";

const NUMBERS = /\d[\d.,]*e[-+]?\d+|true|false/gi;

/** What a file most likely is; a table with words in its first row, or a heading in the comment
 * above it, lists trees. Null: unknown. */
export function kindOf(name: string, beginning: string): FileKind | null {
  const ending = name.split(".").at(-1)?.toLowerCase() ?? "";
  if (ending !== "csv") return ownEntry(BY_ENDING, ending) ?? null;
  const rows = beginning
    .split(/\r\n|\r|\n/)
    .filter((row) => row.trim() !== "" && !/^"?sep=/i.test(row));
  const at = rows.findIndex((row) => !/^[" \t]*#/.test(row));
  const hasWords = /[a-z]/i.test((rows[at] ?? "").replace(NUMBERS, ""));
  return hasWords || /\b(x_|easting)/i.test(rows[at - 1] ?? "") ? "forest" : "grid_map";
}
