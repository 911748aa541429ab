import type { ScenarioCard } from "../link/commands/scenarios.ts";

/** Of what the visitor brought; the server names it so. */
const OWN = "Yours";

/** Cards by section, in their order; the visitor's own come first. */
export function sectionsOf<Card extends Pick<ScenarioCard, "section">>(
  cards: readonly Card[],
): [section: string, cards: Card[]][] {
  const sections = new Map<string, Card[]>([[OWN, []]]);
  for (const card of cards) {
    const { section } = card;
    sections.set(section, [...(sections.get(section) ?? []), card]);
  }
  return [...sections].filter(([, inside]) => inside.length > 0);
}
