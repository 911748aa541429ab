import {
  ActionIcon,
  Button,
  Group,
  NumberInput,
  Popover,
  Stack,
  Text,
  Tooltip,
} from "@mantine/core";
import { ChevronDown, StepForward } from "lucide-react";
import { useState } from "react";
import { PLAYING, step } from "../../link/commands.ts";
import { attempt } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useSimulation } from "../../state/simulation.ts";

/** One physics step, or many; while paused. */
export function Steps() {
  const playing = useSimulation(({ status }) => status?.state === PLAYING);
  const [steps, setSteps] = useState<number>(1000);
  const [busy, setBusy] = useState(false);
  const nothing = useWhyNot();
  const whyNot = nothing ?? (playing ? "Pause the simulation to step it" : null);
  const make = async (number: number) => {
    setBusy(true);
    await attempt("Steps", step(number));
    setBusy(false);
  };
  const disabled = whyNot !== null || busy;
  return (
    <ActionIcon.Group>
      <Tooltip label={whyNot ?? "One physics step (.)"}>
        <ActionIcon
          variant="default"
          size="lg"
          aria-label="Step"
          disabled={disabled}
          onClick={() => void make(1)}
        >
          <StepForward size={18} />
        </ActionIcon>
      </Tooltip>
      <Popover position="bottom" withArrow trapFocus>
        <Popover.Target>
          <ActionIcon variant="default" size="lg" w={18} miw={18} aria-label="Multiple steps">
            <ChevronDown size={14} />
          </ActionIcon>
        </Popover.Target>
        <Popover.Dropdown>
          <Stack gap="xs">
            <Group gap="xs" align="end">
              <NumberInput
                label="Physics steps"
                w={130}
                min={1}
                max={1e9}
                thousandSeparator=" "
                value={steps}
                onChange={(value) => setSteps(Number(value))}
              />
              <Button disabled={disabled || steps < 1} onClick={() => void make(steps)}>
                Step
              </Button>
            </Group>
            {whyNot !== null && (
              <Text size="xs" c="dimmed">
                {whyNot}
              </Text>
            )}
          </Stack>
        </Popover.Dropdown>
      </Popover>
    </ActionIcon.Group>
  );
}
