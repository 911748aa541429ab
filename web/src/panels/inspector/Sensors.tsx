import { Text } from "@mantine/core";
import { useEffect, useMemo, useState } from "react";
import { RateMeter, rateText } from "../../lib/rates.ts";
import { secondsOf } from "../../lib/time.ts";
import type { TopicName } from "../../link/commands.ts";
import { link } from "../../link/link.ts";
import { useTopics } from "../../state/topics.ts";
import { Section } from "./Section.tsx";

const UPDATE_MS = 1000;

/** Too large to be received only to be counted: their tiles and layers show their rates. */
const LARGE = /\/(Image|CompressedImage|PointCloud2|OccupancyGrid|Octomap|MarkerArray)$/;

/** Topics that a UAV subscribes to. */
const COMMANDS = /\/(cmd_vel|goal_pose|trajectory|pose_command)$/;

interface Stamped {
  header?: { stamp: { sec: number; nanosec: number } };
}

/** What a UAV publishes, with the true rates by its stamps. */
export function Sensors({ uav }: { uav: string }) {
  const all = useTopics((topics) => topics.list);
  const own = useMemo(
    () => all.filter(({ name }) => name.startsWith(`/${uav}/`) && !COMMANDS.test(name)),
    [all, uav],
  );
  const rates = useRates(own);
  return (
    <Section title="Sensors and topics">
      {own.length === 0 && (
        <Text size="sm" c="dimmed">
          This UAV publishes no topics.
        </Text>
      )}
      <table className="sensors">
        <tbody>
          {own.map(({ name, type }) => (
            <tr key={name}>
              <td title={type}>{name.slice(uav.length + 2)}</td>
              <td>{LARGE.test(type) ? "" : rateText(rates.get(name) ?? NaN)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </Section>
  );
}

/** Hz by topic, measured while this is shown. */
function useRates(topics: readonly TopicName[]): ReadonlyMap<string, number> {
  const [rates, setRates] = useState<ReadonlyMap<string, number>>(new Map());
  useEffect(() => {
    const meters = new Map<string, RateMeter>();
    const ends = topics
      .filter(({ type }) => !LARGE.test(type))
      .map(({ name, type }) => {
        const meter = new RateMeter();
        meters.set(name, meter);
        return link.subscribe(name, type, ({ message }) => {
          const stamp = (message as Stamped).header?.stamp;
          if (stamp !== undefined) meter.add(secondsOf(stamp));
        });
      });
    const timer = setInterval(
      () => setRates(new Map([...meters].map(([name, meter]) => [name, meter.hz]))),
      UPDATE_MS,
    );
    return () => {
      clearInterval(timer);
      for (const end of ends) end();
    };
  }, [topics]);
  return rates;
}
