import type { TopicName } from "../../link/commands/graph.ts";

const RAW = "sensor_msgs/msg/Image";
const COMPRESSED = "sensor_msgs/msg/CompressedImage";

/** One image topic that can be shown: compressed where there is a choice. */
export interface CameraTopic extends TopicName {
  /** `uav1 front`, `uav1 front depth`. */
  title: string;
}

/** Image topics of all cameras. `compressedDepth` is left to its raw twin, which browsers can read. */
export function cameraTopics(topics: readonly TopicName[]): CameraTopic[] {
  const compressed = new Set(
    topics.filter(({ type }) => type === COMPRESSED).map(({ name }) => name),
  );
  return topics
    .filter(({ name, type }) => {
      if (type === RAW) return !compressed.has(`${name}/compressed`);
      return type === COMPRESSED && !name.endsWith("/compressedDepth");
    })
    .map((topic) => ({ ...topic, title: titleOf(topic.name) }));
}

/** What a person looks at first, before depth and classes. */
export function colourFirst(cameras: readonly CameraTopic[]): CameraTopic[] {
  const derived = ({ name }: CameraTopic) => Number(/depth|labels/.test(name));
  return cameras.toSorted((a, b) => derived(a) - derived(b));
}

export function titleOf(topic: string): string {
  return topic
    .split("/")
    .filter((part) => part !== "" && part !== "compressed" && part !== "image_raw")
    .join(" ");
}
