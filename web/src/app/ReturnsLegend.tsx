import { useShallow } from "zustand/react/shallow";
import {
  colouringOf,
  HIGHEST_M,
  LEVEL,
  NODDING,
  type Bytes,
  type ReturnColouring,
} from "../scene/sensing/returnColours.ts";
import { useTopics } from "../state/topics.ts";
import { useView } from "../state/view.ts";

const TYPES = ["sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"];

/** What the colours of LIDAR returns in the scene mean; nothing where there are none. */
export function ReturnsLegend() {
  const seen = useView(({ show }) => show.lidar);
  const kinds = useTopics(
    useShallow(({ list }) => {
      const topics = list.filter(({ type }) => TYPES.includes(type));
      return [...new Set(topics.map(({ name }) => colouringOf(name)))].sort();
    }),
  );
  if (!seen || kinds.length === 0) return null;
  return (
    <div className="legend" role="note" aria-label="Colours of LIDAR returns">
      {kinds.map((kind) => (
        <Entry key={kind} kind={kind} />
      ))}
    </div>
  );
}

function Entry({ kind }: { kind: ReturnColouring }) {
  switch (kind) {
    case "level":
      return <Dot colour={LEVEL} text="level LIDAR" />;
    case "nodding":
      return <Dot colour={NODDING} text="nodding LIDAR" />;
    case "height":
      return (
        <span>
          LIDAR, height 0 m
          <span className="turbo" style={{ transform: "scaleX(-1)" }} aria-hidden />
          {HIGHEST_M} m
        </span>
      );
  }
}

function Dot({ colour, text }: { colour: Bytes; text: string }) {
  const linear = colour.map((channel) => channel / 255).join(" "); // as the scene takes them
  return (
    <span>
      <span
        className="legend-dot"
        style={{ background: `color(srgb-linear ${linear})` }}
        aria-hidden
      />
      {text}
    </span>
  );
}
