import { useEffect, useRef } from "react";
import { link } from "../../link/link.ts";
import { useTopics } from "../../state/topics.ts";

const SHOWN_MS = 200;

/** The newest path that nodes of a UAV plan: x y in turn; empty: none. */
export function usePlannedPath(uav: string): { readonly current: number[] } {
  const points = useRef<number[]>([]);
  const topic = useTopics(
    ({ list }) =>
      list.find(({ name, type }) => type === "nav_msgs/msg/Path" && name.startsWith(`/${uav}/`))
        ?.name ?? "",
  );
  useEffect(() => {
    points.current = [];
    if (topic === "") return;
    return link.subscribe(
      topic,
      "nav_msgs/msg/Path",
      ({ message }) => {
        points.current = message.poses.flatMap(({ pose }) => [pose.position.x, pose.position.y]);
      },
      { throttleMs: SHOWN_MS, depth: 1 },
    );
  }, [topic]);
  return points;
}
