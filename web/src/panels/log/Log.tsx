import { Badge, Button, Group, ScrollArea, SegmentedControl, Text } from "@mantine/core";
import { Trash2 } from "lucide-react";
import { memo, useState } from "react";
import { matcher } from "../../lib/filter.ts";
import { clockText } from "../../lib/time.ts";
import { clearJournal, useJournal, type Entry, type EntrySort } from "../../state/journal.ts";
import { FilterInput } from "../shared/FilterInput.tsx";
import { JumpTo } from "../shared/JumpTo.tsx";
import classes from "./Log.module.css";

const SORTS = [
  { value: "all", label: "All" },
  { value: "problem", label: "Problems" },
  { value: "event", label: "Events" },
  { value: "command", label: "Commands" },
];
const COLOURS: Record<EntrySort, string> = { problem: "red", event: "gray", command: "cyan" };
const MAX_SHOWN = 300;

/** What happened and what was commanded, the newest first. */
export default function Log() {
  const { entries } = useJournal();
  const [sort, setSort] = useState("all");
  const [filter, setFilter] = useState("");
  const matches = matcher(filter);
  const fitting = entries.filter(
    ({ sort: its, source, kind, text }) =>
      (sort === "all" || its === sort) && matches(`${source} ${kind} ${text}`),
  );
  return (
    <div className={classes.panel}>
      <Group gap="xs" px="sm" pb={4}>
        <SegmentedControl
          size="xs"
          aria-label="Kind of entry"
          data={SORTS}
          value={sort}
          onChange={setSort}
        />
        <FilterInput
          label="Filter the log"
          placeholder="Filter"
          w={220}
          value={filter}
          onChange={setFilter}
        />
        <Button
          size="compact-xs"
          variant="subtle"
          leftSection={<Trash2 size={13} />}
          onClick={clearJournal}
        >
          Clear
        </Button>
        <Text size="xs" c="dimmed">
          {fitting.length} of {entries.length}
        </Text>
      </Group>
      <ScrollArea flex={1} mih={0} type="auto">
        <div role="log" aria-label="Log">
          {fitting
            .slice(-MAX_SHOWN)
            .toReversed()
            .map((entry) => (
              <Row key={entry.number} entry={entry} />
            ))}
        </div>
      </ScrollArea>
    </div>
  );
}

const Row = memo(function Row({ entry }: { entry: Entry }) {
  const { timeS, sort, kind, source, text } = entry;
  return (
    <div className={classes.row}>
      <span className={classes.time}>{clockText(timeS)}</span>
      <Badge size="xs" variant="light" color={COLOURS[sort]} tt="none">
        {kind}
      </Badge>
      {sort === "command" ? (
        <Text span inherit truncate c="dimmed">
          {source}
        </Text>
      ) : (
        <JumpTo uav={source} />
      )}
      <Text span inherit className={classes.text} title={text}>
        {text}
      </Text>
    </div>
  );
});
