import { ActionIcon, Group, Paper, Select, Slider, Text, Tooltip } from "@mantine/core";
import { Pause, Play, Repeat, X } from "lucide-react";
import { useMemo, useState } from "react";
import { Latest } from "../lib/latest.ts";
import { clockText } from "../lib/time.ts";
import { closeRecording, PLAYING, seek, setLoop, setPlaying, setSpeed } from "../link/commands.ts";
import { succeeds } from "../state/notices.ts";
import { usePlayer } from "../state/player.ts";
import { failuresOf } from "../lib/verdicts.ts";
import { useVerdicts } from "../state/verdicts.ts";
import { Expectations } from "./Expectations.tsx";
import classes from "./PlayerBar.module.css";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 0];
const SEEK_MS = 100;
const STEP_S = 0.1;

/** While a recorded log is shown: play, pause, where in it, how fast. */
export function PlayerBar() {
  const { player } = usePlayer();
  const verdicts = useVerdicts();
  const [dragged, setDragged] = useState<number | null>(null);
  const seeking = useMemo(() => new Latest(seek, SEEK_MS), []);
  if (player === null) return null;
  const playing = player.state === PLAYING;
  return (
    <Paper className={classes.bar} withBorder shadow="md" role="group" aria-label="Playback">
      <ActionIcon
        size="lg"
        variant="light"
        aria-label={playing ? "Pause the recording" : "Play the recording"}
        onClick={() => void succeeds("Playback command failed", setPlaying(!playing))}
      >
        {playing ? <Pause size={18} /> : <Play size={18} />}
      </ActionIcon>
      <Text size="sm" ff="monospace">
        {clockText((dragged ?? player.position) - player.start)}
      </Text>
      <Slider
        className={classes.slider}
        min={player.start}
        max={Math.max(player.end, player.start + STEP_S)}
        step={STEP_S}
        value={dragged ?? player.position}
        thumbLabel="Playback time"
        label={(time) => clockText(time - player.start)}
        marks={failuresOf(verdicts).map((value) => ({ value }))}
        classNames={{ mark: classes.failure ?? "" }}
        onChange={(time) => {
          setDragged(time);
          seeking.offer(time);
        }}
        onChangeEnd={() => setDragged(null)}
      />
      <Text size="sm" ff="monospace" c="dimmed">
        {clockText(player.end - player.start)}
      </Text>
      <Expectations />
      <Group gap={4} wrap="nowrap">
        <Select
          size="xs"
          w={82}
          aria-label="Playback speed"
          data={SPEEDS.map((speed) => ({ value: String(speed), label: speedText(speed) }))}
          value={String(player.speed)}
          allowDeselect={false}
          comboboxProps={{ position: "top" }}
          onChange={(speed) => void succeeds("Playback command failed", setSpeed(Number(speed)))}
        />
        <Tooltip label="Loop">
          <ActionIcon
            size="lg"
            variant={player.loop ? "light" : "subtle"}
            aria-label="Loop"
            aria-pressed={player.loop}
            onClick={() => void succeeds("Playback command failed", setLoop(!player.loop))}
          >
            <Repeat size={17} />
          </ActionIcon>
        </Tooltip>
        {player.can_close && (
          <Tooltip label="Close the recording and return to the simulation">
            <ActionIcon
              size="lg"
              variant="subtle"
              aria-label="Close the recording"
              onClick={() => void succeeds("Playback command failed", closeRecording())}
            >
              <X size={17} />
            </ActionIcon>
          </Tooltip>
        )}
      </Group>
    </Paper>
  );
}

function speedText(speed: number): string {
  return speed === 0 ? "max" : `${speed} ×`;
}
