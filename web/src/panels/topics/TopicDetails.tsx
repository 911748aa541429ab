import { Button, Group, Text } from "@mantine/core";
import { Pause, Play, Send } from "lucide-react";
import { useState } from "react";
import { useConnection } from "../../state/connection.ts";
import { openBeside } from "../../state/layout.ts";
import { drawLine } from "../../state/plots.ts";
import type { Followed } from "../shared/useTopic.ts";
import { ValueTree } from "../shared/ValueTree.tsx";
import { PublishForm } from "./PublishForm.tsx";
import classes from "./Topics.module.css";

interface TopicDetailsProps {
  topic: string;
  type: string;
  followed: Followed;
}

/** The newest message of a topic, and a form to publish one. */
export function TopicDetails({ topic, type, followed }: TopicDetailsProps) {
  const [held, setHeld] = useState<unknown>(undefined);
  const [publishing, setPublishing] = useState(false);
  const open = useConnection(({ state }) => state === "open");
  const shown = held ?? followed.message;
  const plot = (path: string) => {
    drawLine({ topic, type, path });
    openBeside("topics", "plots");
  };
  return (
    <div className={classes.details}>
      <Group gap={6} mb={4}>
        <Button
          size="compact-xs"
          variant="default"
          leftSection={held === undefined ? <Pause size={13} /> : <Play size={13} />}
          onClick={() => setHeld(held === undefined ? followed.message : undefined)}
        >
          {held === undefined ? "Freeze values" : "Resume values"}
        </Button>
        <Button
          size="compact-xs"
          variant={publishing ? "light" : "default"}
          leftSection={<Send size={13} />}
          aria-expanded={publishing}
          onClick={() => setPublishing(!publishing)}
        >
          Publish
        </Button>
      </Group>
      {publishing && <PublishForm topic={topic} type={type} />}
      {shown === undefined ? (
        <Text size="sm" c="dimmed">
          {open ? "No message received." : "Not connected."}
        </Text>
      ) : (
        <ValueTree value={shown} onPlot={plot} />
      )}
    </div>
  );
}
