// The points of all lines. They are gathered from when a line is first drawn, also while the panel
// is closed.

import { numberOf, stepsOf, valueAt } from "../../lib/fieldPath.ts";
import { Series } from "../../lib/series.ts";
import { nowMs, secondsOf } from "../../lib/time.ts";
import { link } from "../../link/link.ts";
import { useEpoch } from "../../state/epoch.ts";
import { linesOf, nameOf, usePlots, type Line } from "../../state/plots.ts";

interface Recorded {
  series: Series;
  end: () => void;
}

const recorded = new Map<string, Recorded>();
/** What a page may lag behind before points are lost. */
const DEPTH = 1000;

/** Points of a line; they come from now on if they did not yet. */
export function seriesOf(line: Line): Series {
  const name = nameOf(line);
  let found = recorded.get(name);
  if (found === undefined) {
    found = record(line);
    recorded.set(name, found);
  }
  return found.series;
}

function record({ topic, type, path }: Line): Recorded {
  const series = new Series();
  const steps = stepsOf(path);
  const take = ({ message }: { message: unknown }) =>
    series.push(timeOf(message), numberOf(valueAt(message, steps)));
  return { series, end: link.subscribe(topic, type, take, { depth: DEPTH }) };
}

/** Stamp of a message, or the simulated time of its arrival, s. */
function timeOf(message: unknown): number {
  const { header, stamp } = message as {
    header?: { stamp: { sec: number; nanosec: number } };
    stamp?: { sec: number; nanosec: number };
  };
  const time = header?.stamp ?? stamp;
  return time === undefined ? presentS() : secondsOf(time);
}

/** Simulated time of what came last; of a robot without transforms the page's own clock, s. */
export function presentS(): number {
  return link.frames.stampS > 0 ? link.frames.stampS : nowMs() / 1000;
}

/** Lines that no plot has any more are let go. */
usePlots.subscribe(({ plots }) => {
  const wanted = new Set(plots.flatMap((plot) => linesOf(plot).map(nameOf)));
  for (const [name, { end }] of recorded) {
    if (wanted.has(name)) continue;
    end();
    recorded.delete(name);
  }
});

/** Another world and another log have nothing in common with what was plotted. */
useEpoch.subscribe(({ run }, before) => {
  if (run === before.run) return;
  for (const { series } of recorded.values()) series.clear();
});
