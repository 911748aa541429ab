import { Button, Checkbox, Group, Popover, Select, Stack, Text } from "@mantine/core";
import { Plus } from "lucide-react";
import { useState } from "react";
import { alikeCurves } from "../../lib/usualCurves.ts";
import { drawCurves, type Line } from "../../state/plots.ts";
import { useTopics } from "../../state/topics.ts";
import { Reason } from "../shared/Reason.tsx";
import { usePaths } from "./usePaths.ts";

const MAX_SHOWN = 200;
/** So many UAVs are drawn at once; every one of them is received. */
const MAX_UAVS = 24;

/** Choose one number for each axis of a new curve. */
export function AddCurve({ plot }: { plot: number }) {
  const [opened, setOpened] = useState(false);
  return (
    <Popover opened={opened} onChange={setOpened} position="top-end" withArrow trapFocus>
      <Popover.Target>
        <Button
          size="compact-xs"
          variant="default"
          leftSection={<Plus size={13} />}
          mr={4}
          onClick={() => setOpened(!opened)}
        >
          Curve
        </Button>
      </Popover.Target>
      <Popover.Dropdown w={340} maw="calc(100vw - 24px)">
        <Form plot={plot} done={() => setOpened(false)} />
      </Popover.Dropdown>
    </Popover>
  );
}

function Form({ plot, done }: { plot: number; done: () => void }) {
  const all = useTopics(({ list }) => list);
  const [x, setX] = useState<Line | null>(null);
  const [y, setY] = useState<Line | null>(null);
  const [everyUav, setEveryUav] = useState(false);
  const curve = x !== null && x.path !== "" && y !== null && y.path !== "" ? { x, y } : null;
  const alike = curve === null ? [] : alikeCurves(all, curve);
  const chooseX = (line: Line) => {
    setX(line);
    if (y === null || y.topic === x?.topic) setY(line.topic === y?.topic ? y : emptyOf(line));
  };
  return (
    <form
      aria-label="New curve"
      onSubmit={(event) => {
        event.preventDefault();
        if (curve === null) return;
        drawCurves(plot, everyUav && alike.length > 1 ? alike.slice(0, MAX_UAVS) : [curve]);
        done();
      }}
    >
      <Stack gap="xs">
        <FieldChoice axis="x" line={x} choose={chooseX} />
        <FieldChoice axis="y" line={y} choose={setY} />
        {alike.length > 1 && (
          <Checkbox
            size="xs"
            label={everyUavText(alike.length)}
            checked={everyUav}
            onChange={(event) => setEveryUav(event.currentTarget.checked)}
          />
        )}
        <Group justify="end">
          <Button type="submit" size="xs" disabled={curve === null}>
            Add
          </Button>
        </Group>
      </Stack>
    </form>
  );
}

interface FieldChoiceProps {
  axis: "x" | "y";
  line: Line | null;
  choose: (line: Line) => void;
}

/** A topic, and one of its numbers. */
function FieldChoice({ axis, line, choose }: FieldChoiceProps) {
  const all = useTopics(({ list }) => list);
  const { paths, reason } = usePaths(line?.topic ?? "", line?.type ?? "");
  return (
    <div role="group" aria-label={`${axis} axis`}>
      <Text size="xs" fw={600} mb={2}>
        {axis} axis
      </Text>
      <Stack gap={4}>
        <Select
          size="xs"
          searchable
          limit={MAX_SHOWN}
          aria-label={`Topic of ${axis}`}
          placeholder="Topic"
          data={[...new Set(all.map(({ name }) => name))]}
          value={line?.topic ?? null}
          allowDeselect={false}
          onChange={(topic) => {
            const type = all.find(({ name }) => name === topic)?.type;
            if (topic !== null && type !== undefined) choose({ topic, type, path: "" });
          }}
          comboboxProps={{ withinPortal: false }}
        />
        <Select
          size="xs"
          searchable
          limit={MAX_SHOWN}
          aria-label={`Field of ${axis}`}
          placeholder="Field"
          disabled={line === null}
          data={paths}
          value={line?.path || null}
          allowDeselect={false}
          onChange={(path) => {
            if (line !== null && path !== null) choose({ ...line, path });
          }}
          comboboxProps={{ withinPortal: false }}
        />
      </Stack>
      <Reason>{reason}</Reason>
    </div>
  );
}

function emptyOf(line: Line): Line {
  return { ...line, path: "" };
}

function everyUavText(count: number): string {
  return count > MAX_UAVS ? `The first ${MAX_UAVS} of ${count} UAVs` : `All ${count} UAVs`;
}
