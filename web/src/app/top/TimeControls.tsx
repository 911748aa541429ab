import { ActionIcon, Group, Text, Tooltip } from "@mantine/core";
import { Pause, Play } from "lucide-react";
import { clockText, secondsOf } from "../../lib/time.ts";
import { PLAYING, setPlaying } from "../../link/commands.ts";
import { attempt } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useSimulation } from "../../state/simulation.ts";
import { Expectations } from "../Expectations.tsx";
import { Snapshots } from "./Snapshots.tsx";
import { Reset } from "./Reset.tsx";
import { Speed } from "./Speed.tsx";
import { Steps } from "./Steps.tsx";

/** Start and pause, steps, speed, reset, states to return to, and the simulated clock. */
export function TimeControls() {
  const has = useSimulation(({ status }) => status !== null);
  if (!has) return null;
  return (
    <Group gap={6} wrap="nowrap" className="top-time" role="group" aria-label="Time">
      <PlayPause />
      <Steps />
      <Clock />
      <Expectations />
      <Speed />
      <Reset />
      <Snapshots />
    </Group>
  );
}

function PlayPause() {
  const playing = useSimulation(({ status }) => status?.state === PLAYING);
  const whyNot = useWhyNot();
  const label = playing ? "Pause" : "Play";
  return (
    <Tooltip label={whyNot ?? `${label} (space)`}>
      <ActionIcon
        size="lg"
        aria-label={label}
        disabled={whyNot !== null}
        onClick={() => void attempt(label, setPlaying(!playing))}
      >
        {playing ? <Pause size={18} /> : <Play size={18} />}
      </ActionIcon>
    </Tooltip>
  );
}

function Clock() {
  const seconds = useSimulation(({ status }) => (status === null ? 0 : secondsOf(status.stamp)));
  const paused = useSimulation(({ status }) => status?.state !== PLAYING);
  return (
    <Text
      ff="monospace"
      aria-label="Simulated time"
      className="clock"
      c={paused ? "dimmed" : "bright"}
    >
      {clockText(seconds)}
    </Text>
  );
}
