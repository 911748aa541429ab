import { create } from "zustand";
import { topics, type TopicName } from "../link/commands/graph.ts";
import { link } from "../link/link.ts";

/** Topics of the graph by name; requested every few seconds while they are shown. */
export const useTopics = create<{ list: TopicName[] }>(() => ({ list: [] }));

const ASK_MS = 3000;
/** `uav2` before `uav10`; made once, since a large fleet has ten thousand topics. */
const ORDER = new Intl.Collator("en", { numeric: true });

export function followTopics(): void {
  let asking = false;
  let before: readonly TopicName[] = [];
  const ask = async () => {
    if (asking || link.state !== "open" || document.hidden) return;
    asking = true;
    const list = await topics().catch(() => null);
    asking = false;
    if (list === null || !changed(list, before)) return;
    before = list;
    useTopics.setState({ list: list.toSorted((a, b) => ORDER.compare(a.name, b.name)) });
  };
  link.watch(() => void ask());
  setInterval(() => void ask(), ASK_MS);
}

function changed(now: readonly TopicName[], before: readonly TopicName[]): boolean {
  return (
    now.length !== before.length ||
    now.some(({ name, type }, i) => name !== before[i]!.name || type !== before[i]!.type)
  );
}
