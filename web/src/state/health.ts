// How honest the view is: how old what is shown, how fast it comes, what was lost in between.

import { create } from "zustand";
import { ClockOffset } from "../lib/clockOffset.ts";
import { quantile } from "../lib/quantile.ts";
import { nowMs, secondsOf } from "../lib/time.ts";
import { PLAYING } from "../link/commands.ts";
import { link } from "../link/link.ts";
import { useConnection } from "./connection.ts";
import { useSimulation } from "./simulation.ts";

export interface Health {
  /** Age of what is shown, from its stamp to the frame that shows it, ms; NaN: not known. */
  ageP50Ms: number;
  ageP95Ms: number;
  framesPerS: number;
  /** Share of the last seconds' frames that came more than half a frame late. */
  late: number;
  bytesPerS: number;
  messagesPerS: number;
  /** Messages that the server had to drop for this page since it opened. */
  dropped: number;
  /** Memory of the page's script, bytes; NaN: the browser does not report it. */
  heapBytes: number;
}

const NOTHING: Health = {
  ageP50Ms: NaN,
  ageP95Ms: NaN,
  framesPerS: 0,
  late: 0,
  bytesPerS: 0,
  messagesPerS: 0,
  dropped: 0,
  heapBytes: NaN,
};

export const useHealth = create<Health>(() => NOTHING);

const PUBLISH_MS = 500;
const ASK_MS = 2000;
/** A few seconds at 60 frames a second. */
const FRAMES = 240;
const FRAME_MS = 1000 / 60;

const offset = new ClockOffset();
const ages: number[] = [];
const intervals: number[] = [];
let drawnMs = NaN;
let droppedBefore = NaN;

export function followHealth(): void {
  useConnection.subscribe(({ state }, before) => {
    if (state === before.state) return;
    offset.clear();
    ages.length = 0;
  });
  requestAnimationFrame(frame);
  setInterval(() => void askTime(), ASK_MS);
  setInterval(publish, PUBLISH_MS);
}

/** After the scene was drawn. */
export function noteDrawn(): void {
  const now = nowMs();
  if (!Number.isNaN(drawnMs)) keep(intervals, now - drawnMs);
  drawnMs = now;
}

function frame(): void {
  const age = nowMs() - shownMs();
  if (useSimulation.getState().status?.state !== PLAYING) ages.length = 0;
  else if (!Number.isNaN(age)) keep(ages, age);
  requestAnimationFrame(frame);
}

function keep(values: number[], value: number): void {
  values.push(value);
  if (values.length > FRAMES) values.shift();
}

/** Wall time since the simulation was at this simulated time, s; NaN: not known. */
export function wallAgeS(stampS: number): number {
  return (nowMs() - serverMs(stampS) - offset.ms) / 1000;
}

/** When, on this page's clock, what is shown was so; NaN: not known. */
function shownMs(): number {
  return serverMs(link.frames.stampS) + offset.ms;
}

/** Wall time of a simulated one on the server's clock, ms; NaN: not known. */
function serverMs(stampS: number): number {
  const { status } = useSimulation.getState();
  if (status === null) return NaN;
  const factor = status.real_time_factor > 0 ? status.real_time_factor : 1;
  const since = (stampS - secondsOf(status.stamp)) / factor;
  return 1000 * (secondsOf(status.wall) + since);
}

/** Ask for the simulated time: with the status' pair of times it gives the server's clock. */
async function askTime(): Promise<void> {
  if (link.state !== "open" || useSimulation.getState().status?.state !== PLAYING) return;
  const sentMs = nowMs();
  try {
    const answer = await link.call("/rosapi/get_time", "rosapi_msgs/srv/GetTime", {}, 2);
    const receivedMs = nowMs();
    const { time } = answer as { time: { sec: number; nanosec: number } };
    const timeMs = serverMs(secondsOf(time));
    if (!Number.isNaN(timeMs)) offset.add({ sentMs, serverMs: timeMs, receivedMs });
  } catch {
    // asked again soon
  }
}

function publish(): void {
  const total = intervals.reduce((sum, interval) => sum + interval, 0);
  const dropped = Number(useSimulation.getState().status?.dropped ?? NaN);
  if (Number.isNaN(droppedBefore) || dropped < droppedBefore) droppedBefore = dropped;
  useHealth.setState({
    ageP50Ms: quantile(ages, 0.5),
    ageP95Ms: quantile(ages, 0.95),
    framesPerS: total > 0 ? (1000 * intervals.length) / total : 0,
    late: intervals.filter((ms) => ms > 1.5 * FRAME_MS).length / Math.max(1, intervals.length),
    bytesPerS: link.bytesPerS,
    messagesPerS: link.messagesPerS,
    dropped: Number.isNaN(dropped) ? 0 : dropped - droppedBefore,
    heapBytes: heapBytes(),
  });
}

/** Only Chromium reports it. */
function heapBytes(): number {
  const { memory } = performance as { memory?: { usedJSHeapSize: number } };
  return memory?.usedJSHeapSize ?? NaN;
}
