import { Group, Slider, Text } from "@mantine/core";
import { useState } from "react";

interface DialProps {
  name: string;
  min: number;
  max: number;
  step: number;
  /** As the simulation has confirmed it. */
  value: number;
  text: (value: number) => string;
  disabled: boolean;
  onChange: (value: number) => void;
}

/** After so long the slider is where the simulation has it, though that is not what was wished, ms. */
const SETTLE_MS = 3000;

/** A slider that shows what is confirmed, and while it is held what is wished. */
export function Dial({ name, min, max, step, value, text, disabled, onChange }: DialProps) {
  const [wish, setWish] = useState<number | null>(null);
  const [timer, setTimer] = useState<ReturnType<typeof setTimeout>>();
  // What is wished is shown until the simulation has confirmed it.
  const open = wish !== null && Math.abs(wish - value) > step / 2;
  const shown = open ? wish : value;
  const settle = () => {
    clearTimeout(timer);
    setTimer(setTimeout(() => setWish(null), SETTLE_MS));
  };
  return (
    <div>
      <Group justify="space-between" gap="xs" wrap="nowrap">
        <Text size="sm">{name}</Text>
        <Text size="sm" c={open ? "dimmed" : "bright"} aria-label={`${name} now`}>
          {text(shown)}
        </Text>
      </Group>
      <Slider
        size="sm"
        thumbLabel={name}
        thumbProps={{ "aria-valuetext": text(shown) }}
        label={null}
        min={min}
        max={max}
        step={step}
        value={Math.max(min, Math.min(max, shown))}
        disabled={disabled}
        onChange={(next) => {
          clearTimeout(timer);
          setWish(next);
          onChange(next);
        }}
        onChangeEnd={settle}
      />
    </div>
  );
}
