import { Button, Group, NumberInput, Text } from "@mantine/core";
import { useState } from "react";
import { rebuildScenario } from "../../link/commands.ts";
import { succeeds } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useSimulation } from "../../state/simulation.ts";
import { useWorldPlan } from "../../state/worldPlan.ts";
import { Section } from "../inspector/Section.tsx";

/** How many trees stand; another number builds the world again. */
export function Trees() {
  const scenario = useSimulation(({ server }) => server?.scenario);
  const trees = useWorldPlan(({ plan }) => plan?.trees.length ?? 0);
  const whyNot = useWhyNot();
  const [density, setDensity] = useState<number | "">("");
  const [busy, setBusy] = useState(false);
  if (!scenario || trees === 0) return null;
  const build = async () => {
    setBusy(true);
    const changes = { tree_density_per_ha: Number(density) };
    await succeeds("Trees", rebuildScenario(scenario, changes));
    setBusy(false);
  };
  return (
    <Section title="Trees">
      <Group align="end" gap="xs" wrap="nowrap">
        <NumberInput
          label="Trees per hectare"
          min={0}
          max={10_000}
          value={density}
          onChange={(value) => setDensity(value === "" ? "" : Number(value))}
        />
        <Button
          variant="light"
          loading={busy}
          disabled={whyNot !== null || density === ""}
          onClick={() => void build()}
        >
          Rebuild
        </Button>
      </Group>
      <Text size="xs" c="dimmed">
        Rebuilds the world and restarts the flight.
      </Text>
    </Section>
  );
}
