// Which scenario flies, and with what; uploads. What is not on the graph is asked for over HTTP.

import { order } from "./requests.ts";
import { read } from "./http.ts";

export interface ScenarioCard {
  name: string;
  /** Its name in words. */
  title: string;
  /** Under which heading it stands. */
  section: string;
  description: string;
  uavs: number;
  airframes: string[];
  sensors: string[];
  world: "forest" | "city" | "grid_map" | "open";
  duration_s: number;
  /** Which packages it lacks, with the command that installs them; empty: none. */
  missing: string;
  /** Relative URL; null: none is there. */
  picture: string | null;
  uploaded: boolean;
}

/** What may be set before a scenario starts; what is left out stays as it is written. */
export interface ScenarioChanges {
  uavs?: number;
  airframe?: string;
  sensors?: string[];
  seed?: number;
  tree_density_per_ha?: number;
  tree_share?: number;
  speed?: number;
}

export interface Choices {
  airframes: string[];
  sensor_sets: string[];
  sensor_set_descriptions: string[];
}

/** A world with many trees takes a while until the server answers. */
const LOAD_TIMEOUT_S = 120;

export async function scenarios(): Promise<ScenarioCard[]> {
  return (await get("./api/scenarios")) as ScenarioCard[];
}

/** What `changes` may name. */
export async function choices(): Promise<Choices> {
  return await order<Choices>(
    "/volery/get_scenario_options",
    "volery_interfaces/srv/GetScenarioOptions",
    {},
  );
}

/** What this page has last had flown, and with what. */
let last: { scenario: string; changes: ScenarioChanges } | null = null;

/** Build a world and fly it instead of the present one; the page reconnects meanwhile. */
export async function loadScenario(scenario: string, changes: ScenarioChanges): Promise<void> {
  const request = { scenario, changes: JSON.stringify(changes) };
  const type = "volery_interfaces/srv/LoadScenario";
  await order("/volery/load_scenario", type, request, LOAD_TIMEOUT_S);
  last = { scenario, changes };
}

/** The same world with more changes; those with which this page has started it stay. */
export async function rebuildScenario(scenario: string, more: ScenarioChanges): Promise<void> {
  const kept = last?.scenario === scenario ? last.changes : {};
  await loadScenario(scenario, { ...kept, ...more });
}

export const UPLOAD_KINDS = ["grid_map", "city", "mesh", "forest", "scenario"] as const;
export type UploadKind = (typeof UPLOAD_KINDS)[number];

/** Make a scenario of a file, a .yaml map with its image; its name. */
export async function upload(file: File, kind: UploadKind, image: File | null): Promise<string> {
  const query = new URLSearchParams({ kind, name: file.name });
  if (image !== null) {
    query.set("image", image.name);
    query.set("head", String(file.size));
  }
  const body = image === null ? file : new Blob([file, image]);
  const answer = await fetch(`./api/uploads?${query}`, { method: "POST", body });
  const response = await read(answer);
  return (response as { scenario: string }).scenario;
}

async function get(url: string): Promise<unknown> {
  return await read(await fetch(url, { cache: "no-store" }));
}
