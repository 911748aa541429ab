import { Group, Select } from "@mantine/core";
import { useState } from "react";
import { drawLine } from "../../state/plots.ts";
import { useTopics } from "../../state/topics.ts";
import { Reason } from "../shared/Reason.tsx";
import { usePaths } from "./usePaths.ts";

const MAX_SHOWN = 200;

/** Choose a topic, then one of its numbers. */
export function AddLine({ plot }: { plot: number }) {
  const all = useTopics(({ list }) => list);
  const [topic, setTopic] = useState<string | null>(null);
  const type = all.find(({ name }) => name === topic)?.type ?? "";
  const { paths, reason } = usePaths(topic ?? "", type);
  return (
    <Group gap={6} wrap="nowrap">
      <Select
        size="xs"
        flex={1}
        searchable
        limit={MAX_SHOWN}
        aria-label="Topic of a new line"
        placeholder="Topic"
        data={[...new Set(all.map(({ name }) => name))]}
        value={topic}
        onChange={setTopic}
        comboboxProps={{ position: "top-start" }}
      />
      <Select
        size="xs"
        flex={1}
        searchable
        limit={MAX_SHOWN}
        aria-label="Field of a new line"
        placeholder="Field"
        disabled={topic === null}
        data={paths}
        value={null}
        onChange={(path) => {
          if (topic !== null && path !== null) drawLine({ topic, type, path }, plot);
        }}
        comboboxProps={{ position: "top-start" }}
      />
      <Reason>{reason}</Reason>
    </Group>
  );
}
