// The kind of an actor: from its tags (simulation_interfaces), else its name.

import { link } from "../../link/link.ts";
import { printOf, type TagPrint } from "./tagPrint.ts";

export const KINDS = ["person", "car", "bird", "tag", "thing"] as const;
export type ActorKind = (typeof KINDS)[number];

const NAMES: readonly (readonly [ActorKind, RegExp])[] = [
  ["person", /person|people|pedestrian|walker|hiker|\bman\b|woman|child/i],
  ["car", /car|vehicle|truck|van|bus|jeep/i],
  ["bird", /bird|gull|crow|pigeon|hawk|eagle/i],
];

const prints = new Map<string, TagPrint>();
const received = new Map<string, ActorKind>();
const asked = new Set<string>();

export function kindOf(name: string): ActorKind {
  const known = received.get(name);
  if (known !== undefined) return known;
  ask(name);
  return NAMES.find(([, pattern]) => pattern.test(name))?.[0] ?? "thing";
}

/** The print of an actor of kind tag; null as long as it is not known. */
export function tagPrintOf(name: string): TagPrint | null {
  return prints.get(name) ?? null;
}

/** Grows with each received kind. */
export let kindsVersion = 0;

function ask(name: string): void {
  if (asked.has(name) || link.state !== "open") return;
  asked.add(name);
  link
    .call("/get_entity_info", "simulation_interfaces/srv/GetEntityInfo", { entity: name })
    .then(({ info }) => {
      const kind = KINDS.find((kind) => info.tags.includes(kind));
      if (kind === undefined) return;
      received.set(name, kind);
      const print = printOf(info.tags);
      if (print !== null) prints.set(name, print);
      kindsVersion++;
    })
    .catch(() => undefined); // other graphs have no such service: the name must do
}
