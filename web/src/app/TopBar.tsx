import { Group, Text } from "@mantine/core";
import { Health } from "./Health.tsx";
import { TimeControls } from "./TimeControls.tsx";
import { useSimulation } from "../state/simulation.ts";

/** Name, time and health. */
export function TopBar() {
  const scenario = useSimulation(({ server }) => server?.scenario ?? "");
  return (
    <Group component="header" className="top" justify="space-between" px="sm" py={6} wrap="nowrap">
      <Group gap="sm" wrap="nowrap">
        <img src="./icon.svg" width={24} height={24} alt="" />
        <Text fw={700}>Volery</Text>
        <Text c="dimmed" size="sm" truncate>
          {scenario}
        </Text>
      </Group>
      <TimeControls />
      <Health />
    </Group>
  );
}
