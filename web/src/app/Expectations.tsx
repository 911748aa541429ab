import { Button, Popover, Table, Text, UnstyledButton } from "@mantine/core";
import { CircleAlert, CircleCheck, CircleDashed, CircleX } from "lucide-react";
import { clockText } from "../lib/time.ts";
import { marginText, stateOf, summaryOf, type Verdict } from "../lib/verdicts.ts";
import { seek } from "../link/commands.ts";
import { JumpTo } from "../panels/shared/JumpTo.tsx";
import { succeeds } from "../state/notices.ts";
import { usePlayer } from "../state/player.ts";
import { useVerdicts } from "../state/verdicts.ts";
import classes from "./Expectations.module.css";

const OUTCOMES = {
  passed: { label: "met", icon: CircleCheck, colour: "var(--mantine-color-teal-6)" },
  failed: { label: "failed", icon: CircleX, colour: "var(--mantine-color-red-6)" },
  error: { label: "not judged", icon: CircleAlert, colour: "var(--mantine-color-orange-6)" },
  pending: { label: "not yet", icon: CircleDashed, colour: "var(--mantine-color-dimmed)" },
} as const;

/** How the flight does by the expectations of its scenario; opened, each with its margin. */
export function Expectations() {
  const verdicts = useVerdicts();
  if (verdicts.list.length === 0) return null;
  const summary = summaryOf(verdicts);
  return (
    <Popover width={460} position="bottom" shadow="md" withArrow>
      <Popover.Target>
        <UnstyledButton
          className={classes.button}
          data-state={stateOf(verdicts)}
          aria-label={`Expectations: ${summary}`}
        >
          <OutcomeIcon outcome={stateOf(verdicts)} />
          <span className={classes.summary}>{summary}</span>
        </UnstyledButton>
      </Popover.Target>
      <Popover.Dropdown aria-label="Expectations" className={classes.list}>
        <Text size="xs" c="dimmed" mb={4}>
          {verdicts.over ? "Verdicts on the whole flight" : "Verdicts on the flight so far"}
        </Text>
        <Table fz="xs" verticalSpacing={3} horizontalSpacing={6}>
          <Table.Tbody>
            {verdicts.list.map((verdict) => (
              <Row key={verdict.name} verdict={verdict} />
            ))}
          </Table.Tbody>
        </Table>
      </Popover.Dropdown>
    </Popover>
  );
}

function Row({ verdict }: { verdict: Verdict }) {
  const { name, outcome, text, uav, time_s: time } = verdict;
  return (
    <Table.Tr data-outcome={outcome}>
      <Table.Td w={20}>
        <OutcomeIcon outcome={outcome} />
      </Table.Td>
      <Table.Td className={classes.words}>
        {name}
        <div className={classes.measured}>{text}</div>
      </Table.Td>
      <Table.Td className={classes.margin}>{marginText(verdict)}</Table.Td>
      <Table.Td>{uav !== "" && <JumpTo uav={uav} />}</Table.Td>
      <Table.Td ta="right">{time !== null && <Moment time={time} />}</Table.Td>
    </Table.Tr>
  );
}

/** The moment that decided; a click goes there in a recorded log. */
function Moment({ time }: { time: number }) {
  const start = usePlayer(({ player }) => player?.start);
  if (start === undefined) return <span className={classes.margin}>{clockText(time)}</span>;
  const shown = clockText(time - start);
  return (
    <Button
      size="compact-xs"
      variant="subtle"
      aria-label={`Go to ${shown}`}
      onClick={() => void succeeds("Playback command failed", seek(time))}
    >
      {shown}
    </Button>
  );
}

function OutcomeIcon({ outcome }: { outcome: Verdict["outcome"] }) {
  const { icon: Icon, label, colour } = OUTCOMES[outcome];
  return <Icon size={16} color={colour} role="img" aria-label={label} />;
}
