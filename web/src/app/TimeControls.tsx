import { ActionIcon, Group, Text } from "@mantine/core";
import { Pause, Play } from "lucide-react";
import { clockText, secondsOf } from "../lib/time.ts";
import { setPlaying } from "../link/commands.ts";
import { useSimulation } from "../state/simulation.ts";

const PAUSED = 2;

/** Start and pause, the simulated clock, the real-time factor. */
export function TimeControls() {
  const status = useSimulation((state) => state.status);
  if (status === null) return null;
  const paused = status.state === PAUSED || status.state === 0;
  return (
    <Group gap="xs" wrap="nowrap">
      <ActionIcon
        aria-label={paused ? "Play" : "Pause"}
        onClick={() => void setPlaying(paused)}
        size="lg"
      >
        {paused ? <Play size={18} /> : <Pause size={18} />}
      </ActionIcon>
      <Text ff="monospace" aria-label="Simulated time">
        {clockText(secondsOf(status.stamp))}
      </Text>
      <Text c="dimmed" size="sm" aria-label="Real-time factor">
        {status.real_time_factor.toFixed(2)} ×
      </Text>
    </Group>
  );
}
