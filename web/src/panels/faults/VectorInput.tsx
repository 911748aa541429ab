import { Group, Input, NumberInput } from "@mantine/core";
import type { Vector } from "./fault.ts";

interface VectorInputProps {
  label: string;
  value: Vector;
  onChange: (value: Vector) => void;
}

const AXES = ["east", "north", "up"];

/** Three numbers in the map. */
export function VectorInput({ label, value, onChange }: VectorInputProps) {
  return (
    <Input.Wrapper size="xs" label={label} miw={220}>
      <Group gap={4} wrap="nowrap">
        {AXES.map((axis, i) => (
          <NumberInput
            key={axis}
            size="xs"
            hideControls
            aria-label={`${label}, ${axis}`}
            title={axis}
            value={value[i]!}
            onChange={(changed) => onChange(value.with(i, Number(changed)) as Vector)}
          />
        ))}
      </Group>
    </Input.Wrapper>
  );
}
