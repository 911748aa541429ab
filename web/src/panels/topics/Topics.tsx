import { Button, Group, ScrollArea, Text } from "@mantine/core";
import { useState } from "react";
import { matcher } from "../../lib/filter.ts";
import { useTopics } from "../../state/topics.ts";
import { FilterInput } from "../shared/FilterInput.tsx";
import { TopicRow } from "./TopicRow.tsx";
import classes from "./Topics.module.css";

const PAGE = 150;

/** Every topic; one that is ticked or unfolded is received, and its true rate and size shown. */
export default function Topics() {
  const all = useTopics(({ list }) => list);
  const [filter, setFilter] = useState("");
  const [shown, setShown] = useState(PAGE);
  const matches = matcher(filter);
  const fitting = all.filter(({ name, type }) => matches(`${name} ${type}`));
  return (
    <div className={classes.panel}>
      <Group gap="xs" px="sm" pb={6}>
        <FilterInput
          label="Filter topics"
          placeholder="Filter by name or type"
          w={260}
          value={filter}
          onChange={setFilter}
        />
        <Text size="xs" c="dimmed">
          {fitting.length} of {all.length}
        </Text>
      </Group>
      <div className={`${classes.row} ${classes.head}`} aria-hidden>
        <span />
        <span>Topic</span>
        <span className={classes.type}>Type</span>
        <span className={classes.number}>Rate</span>
        <span className={classes.number}>Size</span>
        <span className={classes.number}>Bandwidth</span>
      </div>
      <ScrollArea className={classes.list} type="auto">
        <div role="list" aria-label="Topics">
          {fitting.slice(0, shown).map((topic) => (
            <TopicRow key={`${topic.name} ${topic.type}`} {...topic} />
          ))}
        </div>
        {fitting.length > shown && (
          <Button size="compact-xs" variant="subtle" onClick={() => setShown(shown + 2 * PAGE)}>
            {fitting.length - shown} more
          </Button>
        )}
      </ScrollArea>
    </div>
  );
}
