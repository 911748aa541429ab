// What there is on the graph.

import { link } from "../link.ts";

export interface TopicName {
  name: string;
  /** As `sensor_msgs/msg/Image`. */
  type: string;
}

/** All topics. */
export async function topics(): Promise<TopicName[]> {
  const answer = (await link.call("/rosapi/topics", "rosapi_msgs/srv/Topics", {})) as {
    topics: string[];
    types: string[];
  };
  return answer.topics.map((name, i) => ({ name, type: withMsg(answer.types[i] ?? "") }));
}

/** One message of a topic; rejects where none comes in time. */
export function nextMessage(topic: string, type: string, timeoutMs: number): Promise<unknown> {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => {
      end();
      reject(new Error(`${topic}: no message received`));
    }, timeoutMs);
    const end = link.subscribe(topic, type, ({ message }) => {
      clearTimeout(timer);
      queueMicrotask(() => end()); // a latched one comes while `subscribe` runs
      resolve(message);
    });
  });
}

/** ROS 1 leaves the `msg` out. */
function withMsg(type: string): string {
  return type.includes("/msg/") ? type : type.replace("/", "/msg/");
}
