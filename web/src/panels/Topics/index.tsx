import { Button, Group, ScrollArea, Text, TextInput } from "@mantine/core";
import { RefreshCw, Search } from "lucide-react";
import { useState } from "react";
import { topics, type TopicName } from "../../link/commands.ts";
import { Reason } from "../shared/Reason.tsx";
import { useAsked } from "../shared/useAsked.ts";
import { TopicRow } from "./TopicRow.tsx";
import classes from "./Topics.module.css";

const NONE: TopicName[] = [];
const ASK_MS = 3000;
const PAGE = 150;

/** Every topic; one that is ticked or unfolded is received, and its true rate and size told. */
export default function Topics() {
  const { value: all, reason, again } = useAsked(topics, NONE, ASK_MS);
  const [sought, setSought] = useState("");
  const [shown, setShown] = useState(PAGE);
  const words = sought.toLowerCase().split(/\s+/);
  const fitting = all.filter(({ name, type }) => {
    const text = `${name} ${type}`.toLowerCase();
    return words.every((word) => text.includes(word));
  });
  return (
    <div className={classes.panel}>
      <Group gap="xs" px="sm" pb={6}>
        <TextInput
          size="xs"
          w={260}
          leftSection={<Search size={14} />}
          placeholder="Filter by name or type"
          aria-label="Filter topics"
          value={sought}
          onChange={(event) => setSought(event.currentTarget.value)}
        />
        <Text size="xs" c="dimmed">
          {fitting.length} of {all.length}
        </Text>
        <Button
          size="compact-xs"
          variant="subtle"
          leftSection={<RefreshCw size={13} />}
          onClick={again}
        >
          Refresh
        </Button>
        <Reason>{reason}</Reason>
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
