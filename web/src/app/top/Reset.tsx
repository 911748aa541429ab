import { Button, Divider, Group, NumberInput, Text } from "@mantine/core";
import { RotateCcw } from "lucide-react";
import { useState } from "react";
import { loadScenario, reset } from "../../link/commands.ts";
import { succeeds, showSuccess } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useSimulation } from "../../state/simulation.ts";
import { TopPopover } from "./TopPopover.tsx";

/** Back to the start: the same flight once more, or one with another seed. */
export function Reset() {
  const scenario = useSimulation(({ server, status }) => server?.scenario || status?.scenario);
  const [opened, setOpened] = useState(false);
  const [seed, setSeed] = useState<number>(1);
  const whyNot = useWhyNot();
  const run = async (what: Promise<void>, done: string) => {
    setOpened(false);
    if (await succeeds("Reset", what)) showSuccess(done);
  };
  return (
    <TopPopover
      label="Reset"
      hint={whyNot ?? "Reset the simulation"}
      icon={<RotateCcw size={18} />}
      position="bottom"
      width={290}
      opened={opened}
      onChange={setOpened}
      disabled={whyNot !== null}
    >
      <Button onClick={() => void run(reset(), "The simulation is reset")}>Reset, same seed</Button>
      <Text size="xs" c="dimmed">
        Repeats the same flight bit for bit and removes added UAVs.
      </Text>
      <Divider />
      <Group align="end" gap="xs" wrap="nowrap">
        <NumberInput
          label="Seed"
          min={0}
          max={Number.MAX_SAFE_INTEGER}
          allowDecimal={false}
          value={seed}
          onChange={(value) => setSeed(Number(value))}
        />
        <Button
          variant="default"
          disabled={!scenario}
          onClick={() => void run(loadScenario(scenario!, { seed }), `Restarted with seed ${seed}`)}
        >
          New seed
        </Button>
      </Group>
      <Text size="xs" c="dimmed">
        Loads the scenario as written, with different noise and a different procedural world.
      </Text>
    </TopPopover>
  );
}
