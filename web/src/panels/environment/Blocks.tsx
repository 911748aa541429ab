import { Select } from "@mantine/core";
import { useCallback, useEffect, useMemo, useState } from "react";
import { Latest } from "../../lib/latest.ts";
import { gridMap, setGridMap, type GridMap } from "../../link/commands.ts";
import { succeeds } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useSimulation } from "../../state/simulation.ts";
import { Section } from "../inspector/Section.tsx";
import { FieldDials, type DialField } from "./FieldDials.tsx";

/** Blocks are built again with each change: fewer of them than of weather, ms. */
const SEND_MS = 250;

const FIELDS: readonly DialField<"block_height" | "cell_size">[] = [
  {
    key: "block_height",
    name: "Height",
    min: 0.5,
    max: 30,
    step: 0.5,
    text: (height) => `${height.toFixed(1)} m`,
  },
  {
    key: "cell_size",
    name: "Cell size",
    min: 0.5,
    max: 10,
    step: 0.25,
    text: (size) => `${size.toFixed(2)} m`,
  },
];

/** Height and size of obstacles, and which map of them stands; only in a world that has one. */
export function Blocks() {
  const [map, setMap] = useState<GridMap | null>(null);
  const world = useSimulation(({ server }) => server?.world ?? null);
  const scenario = useSimulation(({ status }) => status?.scenario);
  const whyNot = useWhyNot();
  const refresh = useCallback(async () => setMap(await gridMap().catch(() => null)), []);
  useEffect(() => void refresh(), [refresh, world, scenario]);
  const sender = useMemo(
    () =>
      new Latest<Parameters<typeof setGridMap>[0]>(async (change) => {
        await succeeds("Obstacles", setGridMap(change));
        await refresh();
      }, SEND_MS),
    [refresh],
  );
  if (map === null) return null;
  const disabled = whyNot !== null;
  return (
    <Section title="Obstacles">
      {map.names.length > 0 && (
        <Select
          label="Map"
          data={map.names}
          value={map.name}
          disabled={disabled}
          allowDeselect={false}
          onChange={(name) => name !== null && sender.offer({ name })}
        />
      )}
      <FieldDials
        fields={FIELDS}
        values={map}
        disabled={disabled}
        change={(changes) => sender.offer(changes)}
      />
    </Section>
  );
}
