import { Popover, Progress, Stack, Table, Text, UnstyledButton } from "@mantine/core";
import { rateText } from "../lib/rates.ts";
import { bytesText } from "../lib/traffic.ts";
import { useHealth } from "../state/health.ts";
import { useSimulation } from "../state/simulation.ts";
import classes from "./Health.module.css";

/** Beyond this a person feels that the view lags, ms. */
const OLD_MS = 100;
const VERY_OLD_MS = 300;

/** A small meter of how old what is shown is; opened, all that bears on it. */
export function Health() {
  const { ageP95Ms, framesPerS } = useHealth();
  return (
    <Popover width={300} position="bottom-end" shadow="md" withArrow>
      <Popover.Target>
        <UnstyledButton
          className={classes.meter}
          aria-label={`Health: display latency ${ageText(ageP95Ms)}`}
        >
          <span className={classes.lamp} data-state={stateOf(ageP95Ms)} />
          <span>{ageText(ageP95Ms)}</span>
          <span className={classes.frames}>{framesPerS.toFixed(0)} fps</span>
        </UnstyledButton>
      </Popover.Target>
      <Popover.Dropdown aria-label="Health">
        <Details />
      </Popover.Dropdown>
    </Popover>
  );
}

function Details() {
  const health = useHealth();
  const status = useSimulation((simulation) => simulation.status);
  const rows: [string, string][] = [
    ["Display latency, median", ageText(health.ageP50Ms)],
    ["Display latency, 95th percentile", ageText(health.ageP95Ms)],
    [
      "Frames",
      `${health.framesPerS.toFixed(0)} per second, ${(100 * health.late).toFixed(0)} % late`,
    ],
    ["Received", `${bytesText(health.bytesPerS)}/s, ${rateText(health.messagesPerS)}`],
    ["Messages dropped for slow clients", String(health.dropped)],
    ["Page memory", bytesText(health.heapBytes)],
    ["Simulation memory", bytesText(1e6 * (status?.memory ?? NaN))],
    ["Clients", String(status?.clients ?? "–")],
  ];
  return (
    <Stack gap={6}>
      <Table fz="xs" verticalSpacing={2} horizontalSpacing={0} withRowBorders={false}>
        <Table.Tbody>
          {rows.map(([name, value]) => (
            <Table.Tr key={name}>
              <Table.Td c="dimmed">{name}</Table.Td>
              <Table.Td ta="right" className={classes.value}>
                {value}
              </Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
      {status !== null && <Load stages={status.stages} load={Array.from(status.load)} />}
    </Stack>
  );
}

/** Share of a second that each stage computes for a second of simulated time. */
function Load({ stages, load }: { stages: string[]; load: number[] }) {
  return (
    <div>
      <Text size="xs" c="dimmed">
        Computation per simulated second
      </Text>
      {stages.map((stage, i) => (
        <div key={stage} className={classes.stage}>
          <span>{stage.replaceAll("_", " ")}</span>
          <Progress value={100 * (load[i] ?? 0)} size="sm" aria-label={stage} />
          <span className={classes.value}>{(1000 * (load[i] ?? 0)).toFixed(0)} ms</span>
        </div>
      ))}
    </div>
  );
}

function ageText(ms: number): string {
  if (Number.isNaN(ms)) return "– ms";
  return ms < 10_000 ? `${Math.max(0, ms).toFixed(0)} ms` : `${(ms / 1000).toFixed(0)} s`;
}

function stateOf(ms: number): string {
  if (Number.isNaN(ms)) return "unknown";
  return ms < OLD_MS ? "good" : ms < VERY_OLD_MS ? "old" : "very-old";
}
