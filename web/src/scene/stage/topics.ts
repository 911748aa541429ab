// Which topics there are: requested from rosapi every few seconds, for the layers that show every
// topic of a type.

import { link } from "../../link/link.ts";

const ASK_MS = 3000;
const TIMEOUT_S = 10;

/** Topics by name, with their types. */
let known = new Map<string, string>();
const followers = new Set<Follower>();
let asking = false;

export class Follower {
  private readonly ends = new Map<string, () => void>();
  private enabled = true;

  constructor(
    private readonly types: readonly string[],
    private readonly begin: (topic: string, type: string) => (() => void) | null,
    private readonly gone: (topic: string) => void,
  ) {}

  /** Receive, or stop receiving. */
  enable(enabled: boolean): void {
    if (enabled === this.enabled) return;
    this.enabled = enabled;
    this.look();
  }

  /** Go on with those topics alone that are wanted; others may begin with the next look. */
  choose(wanted: (topic: string) => boolean): void {
    for (const [topic, end] of this.ends) {
      if (wanted(topic)) continue;
      end();
      this.ends.delete(topic);
      this.gone(topic);
    }
  }

  /** Begin with what is new, end what is gone. */
  look(): void {
    for (const [topic, end] of this.ends) {
      if (this.enabled && known.has(topic)) continue;
      end();
      this.ends.delete(topic);
      this.gone(topic);
    }
    if (!this.enabled) return;
    for (const [topic, type] of known) {
      if (this.ends.has(topic) || !this.types.includes(type)) continue;
      const end = this.begin(topic, type);
      if (end !== null) this.ends.set(topic, end);
    }
  }

  end(): void {
    followers.delete(this);
    for (const end of this.ends.values()) end();
    this.ends.clear();
  }
}

/** Receive all topics of some types; `begin` says how to end one, or null for one not wanted. */
export function followTopics(
  types: readonly string[],
  begin: (topic: string, type: string) => (() => void) | null,
  gone: (topic: string) => void,
): Follower {
  const follower = new Follower(types, begin, gone);
  followers.add(follower);
  follower.look();
  if (!asking) {
    asking = true;
    link.watch(() => {
      if (link.state === "open") void ask();
    });
    void ask();
    setInterval(() => void ask(), ASK_MS);
  }
  return follower;
}

export function topicsOf(type: string): string[] {
  return [...known].flatMap(([topic, its]) => (its === type ? [topic] : []));
}

export function isKnown(topic: string): boolean {
  return known.has(topic);
}

let inFlight = false;

async function ask(): Promise<void> {
  if (inFlight || link.state !== "open") return;
  inFlight = true;
  try {
    const { topics, types } = await link.call(
      "/rosapi/topics",
      "rosapi_msgs/srv/Topics",
      {},
      TIMEOUT_S,
    );
    known = new Map(topics.map((topic, i) => [topic, typeNamed(types[i] ?? "")]));
    for (const follower of followers) follower.look();
  } catch {
    // a graph without rosapi shows what has fixed names
  } finally {
    inFlight = false;
  }
}

/** ROS 1 leaves out the `msg`. */
function typeNamed(type: string): string {
  const parts = type.split("/");
  return parts.length === 2 ? `${parts[0]}/msg/${parts[1]}` : type;
}
