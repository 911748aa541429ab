import { Checkbox, Text, UnstyledButton } from "@mantine/core";
import { ChevronDown, ChevronRight } from "lucide-react";
import { memo, useState } from "react";
import { rateText } from "../../lib/rates.ts";
import { bytesText } from "../../lib/traffic.ts";
import { useTopic } from "../shared/useTopic.ts";
import { TopicDetails } from "./TopicDetails.tsx";
import classes from "./Topics.module.css";

interface TopicRowProps {
  name: string;
  type: string;
}

/** One topic. It is received while it is ticked or unfolded, since receiving costs. */
export const TopicRow = memo(function TopicRow({ name, type }: TopicRowProps) {
  const [open, setOpen] = useState(false);
  const [ticked, setTicked] = useState(false);
  const measured = open || ticked;
  const followed = useTopic(name, type, measured);
  return (
    <div role="listitem" aria-label={name}>
      <div className={classes.row}>
        <Checkbox
          size="xs"
          checked={measured}
          disabled={open}
          aria-label={`Measure ${name}`}
          onChange={(event) => setTicked(event.currentTarget.checked)}
        />
        <UnstyledButton
          className={classes.name}
          aria-expanded={open}
          onClick={() => setOpen(!open)}
          title={name}
        >
          {open ? <ChevronDown size={14} /> : <ChevronRight size={14} />}
          <Text span inherit truncate>
            {name}
          </Text>
        </UnstyledButton>
        <Text span inherit truncate c="dimmed" className={classes.type} title={type}>
          {type}
        </Text>
        <span className={classes.number} data-kind="rate">
          {measured ? rateText(followed.hz) : ""}
        </span>
        <span className={classes.number} data-kind="size">
          {measured ? bytesText(followed.bytes) : ""}
        </span>
        <span className={classes.number} data-kind="bandwidth">
          {measured ? `${bytesText(followed.bytesPerS)}/s` : ""}
        </span>
      </div>
      {open && <TopicDetails topic={name} type={type} followed={followed} />}
    </div>
  );
});
