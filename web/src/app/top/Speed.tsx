import { Button, Popover, Slider, Stack, Text, Tooltip } from "@mantine/core";
import { useMemo, useState } from "react";
import { Latest } from "../../lib/latest.ts";
import { END, positionOf, SPEED_MARKS, speedOf, speedText } from "../../lib/speed.ts";
import { PLAYING, setSpeed } from "../../link/commands.ts";
import { succeeds } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useSimulation } from "../../state/simulation.ts";

const SEND_MS = 100;
const MARKS = SPEED_MARKS.map((speed) => ({
  value: positionOf(speed),
  label: speed === 0 ? "max" : String(speed),
}));

/** The wanted speed and the one that is reached. */
export function Speed() {
  const wanted = useSimulation(({ status }) => status?.speed ?? 1);
  const reached = useSimulation(({ status }) => status?.real_time_factor ?? 0);
  const playing = useSimulation(({ status }) => status?.state === PLAYING);
  const behind = playing && wanted > 0 && reached < 0.9 * wanted;
  return (
    <Popover position="bottom" withArrow trapFocus>
      <Popover.Target>
        <Button variant="default" size="compact-md" h={34} px={8} aria-label="Speed">
          <Text inherit span fw={600}>
            {speedText(wanted)}
          </Text>
          <Tooltip label="Measured real-time factor">
            <Text
              span
              ff="monospace"
              size="xs"
              ml={6}
              c={behind ? "orange" : "dimmed"}
              aria-label="Real-time factor"
              className="reached"
            >
              {playing ? reached.toFixed(2) : "–"}
            </Text>
          </Tooltip>
        </Button>
      </Popover.Target>
      <Popover.Dropdown w={400} maw="96vw">
        <SpeedSlider wanted={wanted} />
        {behind && (
          <Text size="xs" c="orange" mt="sm">
            This machine reaches {reached.toFixed(2)} times real time with this scenario.
          </Text>
        )}
      </Popover.Dropdown>
    </Popover>
  );
}

function SpeedSlider({ wanted }: { wanted: number }) {
  const whyNot = useWhyNot();
  const [dragged, setDragged] = useState<number | null>(null);
  const sender = useMemo(
    () => new Latest<number>(async (to) => void (await succeeds("Speed", setSpeed(to))), SEND_MS),
    [],
  );
  return (
    <Stack gap={4} pb="md" px="xs">
      <Text size="sm">Times real time: {speedText(dragged ?? wanted)}</Text>
      <Slider
        thumbLabel="Speed"
        disabled={whyNot !== null}
        min={0}
        max={END}
        step={0.5}
        marks={MARKS}
        value={positionOf(dragged ?? wanted)}
        label={null}
        thumbProps={{ "aria-valuetext": speedText(dragged ?? wanted) }}
        onChange={(position) => {
          setDragged(speedOf(position));
          sender.offer(speedOf(position));
        }}
        onChangeEnd={() => setTimeout(() => setDragged(null), 600)}
      />
    </Stack>
  );
}
