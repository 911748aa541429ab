import { useEffect, useState } from "react";
import { TrafficMeter } from "../../lib/traffic.ts";
import { nowMs } from "../../lib/time.ts";
import { link } from "../../link/link.ts";

export interface Followed {
  /** Messages/s of the last seconds. */
  hz: number;
  bytesPerS: number;
  /** Mean size of a message. */
  bytes: number;
  /** The newest message; undefined: none has come. */
  message: unknown;
  /** Wall time of its arrival, ms. */
  arrivedMs: number;
}

const NOTHING: Followed = { hz: 0, bytesPerS: 0, bytes: NaN, message: undefined, arrivedMs: NaN };
const SHOW_MS = 250;
/** Bursts between two posts of the page's worker must not count as lost. */
const DEPTH = 100;

/** Every message of a topic, updated a few times a second; while not `wanted` nothing is received. */
export function useTopic(topic: string, type: string, wanted: boolean): Followed {
  const [followed, setFollowed] = useState(NOTHING);
  useEffect(() => {
    if (!wanted) {
      setFollowed(NOTHING);
      return undefined;
    }
    const meter = new TrafficMeter();
    let message: unknown;
    let arrivedMs = NaN;
    const end = link.subscribe(
      topic,
      type,
      (received) => {
        meter.add(received.arrivedMs, received.bytes);
        message = received.message;
        arrivedMs = received.arrivedMs;
      },
      { depth: DEPTH },
    );
    const show = () => setFollowed({ ...meter.read(nowMs()), message, arrivedMs });
    const timer = setInterval(show, SHOW_MS);
    return () => {
      clearInterval(timer);
      end();
    };
  }, [topic, type, wanted]);
  return followed;
}
