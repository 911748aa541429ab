// What there is on the graph.

import { link } from "../link.ts";

export interface TopicName {
  name: string;
  /** As `sensor_msgs/msg/Image`. */
  type: string;
}

/** All topics, by name. */
export async function topics(): Promise<TopicName[]> {
  const answer = (await link.call("/rosapi/topics", "rosapi_msgs/srv/Topics", {})) as {
    topics: string[];
    types: string[];
  };
  return answer.topics
    .map((name, i) => ({ name, type: withMsg(answer.types[i] ?? "") }))
    .sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
}

/** ROS 1 leaves the `msg` out. */
function withMsg(type: string): string {
  return type.includes("/msg/") ? type : type.replace("/", "/msg/");
}
