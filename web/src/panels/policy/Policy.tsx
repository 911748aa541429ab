import { Badge, Group, ScrollArea, Stack, Text } from "@mantine/core";
import { useEffect, useMemo, useState } from "react";
import { useVehicles } from "../../state/vehicles.ts";
import { useTopic } from "../shared/useTopic.ts";
import {
  actionBars,
  descriptionOf,
  extentOf,
  observationBars,
  polyline,
  statusOf,
  withSample,
  type BarGroup,
  type Sample,
} from "./policy.ts";
import classes from "./Policy.module.css";
import { ownEntry } from "../../lib/ownEntry.ts";

const STRING = "std_msgs/msg/String";
const NUMBERS = "std_msgs/msg/Float32MultiArray";
const COLOURS: Record<string, string> = { flying: "green", holding: "orange", waiting: "gray" };
const WIDTH = 600;
const HEIGHT = 50;

/** The policy that flies the selected UAV: what it observes, does and expects. */
export default function Policy() {
  const uav = useVehicles(({ selected }) => selected);
  return uav === null || uav === "" ? (
    <Text p="sm" c="dimmed">
      No UAV is selected.
    </Text>
  ) : (
    <PolicyOf key={uav} uav={uav} />
  );
}

function PolicyOf({ uav }: { uav: string }) {
  const topic = (name: string) => `/${uav}/policy/${name}`;
  const described = textIn(useTopic(topic("description"), STRING, true).message);
  const status = statusOf(textIn(useTopic(topic("status"), STRING, true).message));
  const description = useMemo(() => descriptionOf(described), [described]);
  const isKnown = description !== null;
  const observation = useTopic(topic("observation"), NUMBERS, isKnown).message;
  const action = useTopic(topic("action"), NUMBERS, isKnown).message;
  const value = useTopic(topic("value"), "std_msgs/msg/Float32", isKnown);
  const samples = useSamples(numberIn(value.message), value.arrivedMs);
  if (description === null) {
    return (
      <Text p="sm" c="dimmed">
        No policy flies {uav}: its type has no node `policy`.
      </Text>
    );
  }
  return (
    <ScrollArea h="100%" type="auto">
      <Stack gap="xs" px="sm" pb="sm">
        <Group gap="xs">
          <Badge variant="light" tt="none" color={ownEntry(COLOURS, status?.state ?? "") ?? "gray"}>
            {status?.state ?? "unknown"}
          </Badge>
          <Text size="sm" fw={500}>
            {status?.policy ?? ""}
          </Text>
          <Text size="xs" c="dimmed">
            task {description.task}, trained with {description.airframe}, {description.rateHz} Hz
          </Text>
          <Text size="xs" c="orange">
            {status?.reason ?? ""}
          </Text>
        </Group>
        <div className={classes.groups}>
          <Bars title="Action" group={actionBars(description, numbersIn(action))} />
          {observationBars(description.parts, numbersIn(observation)).map((group) => (
            <Bars key={group.name} title={group.name} group={group} />
          ))}
        </div>
        {samples.length > 0 && <Value samples={samples} />}
      </Stack>
    </ScrollArea>
  );
}

function Bars({ title, group }: { title: string; group: BarGroup }) {
  return (
    <section className={classes.group} aria-label={title}>
      <Text size="xs" c="dimmed">
        {title === group.name ? title : `${title}: ${group.name}`}
      </Text>
      {group.bars.map((bar, k) => {
        const { left, width } = extentOf(bar.value);
        return (
          <div key={k} className={classes.row}>
            <span>{bar.label}</span>
            <div className={classes.track}>
              <div className={classes.bar} style={{ left: `${left}%`, width: `${width}%` }} />
              <div className={classes.middle} />
            </div>
            <span className={classes.text}>{bar.text}</span>
          </div>
        );
      })}
      {group.hidden > 0 && (
        <Text size="xs" c="dimmed">
          and {group.hidden} more numbers
        </Text>
      )}
    </section>
  );
}

function Value({ samples }: { samples: readonly Sample[] }) {
  return (
    <section aria-label="Value">
      <Text size="xs" c="dimmed">
        Value, expected return: {samples.at(-1)?.value.toFixed(2)}
      </Text>
      <svg className={classes.value} viewBox={`0 -3 ${WIDTH} 56`} preserveAspectRatio="none">
        <polyline
          points={polyline(samples, WIDTH, HEIGHT)}
          fill="none"
          stroke="currentColor"
          vectorEffect="non-scaling-stroke"
        />
      </svg>
    </section>
  );
}

/** The values of the last half minute. */
function useSamples(value: number, arrivedMs: number): Sample[] {
  const [samples, setSamples] = useState<Sample[]>([]);
  useEffect(() => {
    if (Number.isFinite(value) && Number.isFinite(arrivedMs)) {
      setSamples((before) => withSample(before, { timeMs: arrivedMs, value }));
    }
  }, [value, arrivedMs]);
  return samples;
}

function textIn(message: unknown): string {
  const data = (message as { data?: unknown } | undefined)?.data;
  return typeof data === "string" ? data : "";
}

function numberIn(message: unknown): number {
  const data = (message as { data?: unknown } | undefined)?.data;
  return typeof data === "number" ? data : NaN;
}

function numbersIn(message: unknown): ArrayLike<number> {
  const data = (message as { data?: unknown } | undefined)?.data;
  return Array.isArray(data) || data instanceof Float32Array ? (data as ArrayLike<number>) : [];
}
