import { Button, Group, Text, Tooltip } from "@mantine/core";
import { MousePointerClick } from "lucide-react";
import { counted } from "../../lib/counted.ts";
import { goByClick } from "../../state/goals.ts";
import { useWhyNot } from "../../state/rights.ts";
import { select, useVehicles } from "../../state/vehicles.ts";
import { FlightCommands } from "./FlightCommands.tsx";
import { Section } from "./Section.tsx";

/** Commands to all UAVs that are selected together. */
export function GroupCommands({ uavs }: { uavs: readonly string[] }) {
  const whyNot = useWhyNot();
  const lead = useVehicles(({ selected }) => selected);
  return (
    <Section title={`${counted(uavs.length, "UAV")} selected`}>
      <FlightCommands uavs={uavs} />
      <Group gap={6} mt={6} grow preventGrowOverflow={false}>
        <Tooltip
          label={whyNot ?? "Click the position of their middle; they keep their formation (G)"}
        >
          <Button
            size="compact-md"
            h={34}
            variant="light"
            leftSection={<MousePointerClick size={16} />}
            disabled={whyNot !== null}
            onClick={() => void goByClick(uavs)}
          >
            Go to
          </Button>
        </Tooltip>
        <Button size="compact-md" h={34} variant="default" onClick={() => select(lead)}>
          Select {lead} only
        </Button>
      </Group>
      <Text size="xs" c="dimmed" mt={6}>
        Below: {lead}
      </Text>
    </Section>
  );
}
