// @vitest-environment happy-dom
import { expect, it, vi } from "vitest";

type Listener = (received: { message: unknown }) => void;
const listeners = new Map<string, Set<Listener>>();
const link = {
  frames: { stampS: 0 },
  subscribe: (topic: string, _type: string, listener: Listener) => {
    if (!listeners.has(topic)) listeners.set(topic, new Set());
    listeners.get(topic)!.add(listener);
    return () => listeners.get(topic)!.delete(listener);
  },
  watch: () => 0,
};
vi.mock("../../link/link.ts", () => ({ link }));

const { useEpoch } = await import("../../state/epoch.ts");
const { addXYPlot, removePlot, usePlots } = await import("../../state/plots.ts");
const { curveOf } = await import("../../lib/curve.ts");
const { seriesOf } = await import("./recorder.ts");

const of = (path: string) => ({ topic: "/uav1/odom", type: "nav_msgs/msg/Odometry", path });
const [x, y] = [of("pose.pose.position.x"), of("pose.pose.position.y")];

function publish(sec: number, position: { x: number; y: number }): void {
  const message = {
    header: { stamp: { sec, nanosec: 0 } },
    pose: { pose: { position: { ...position, z: 0 } } },
  };
  for (const listener of listeners.get("/uav1/odom") ?? []) listener({ message });
}

const drawn = () => curveOf(seriesOf(x), seriesOf(y), -100, 1000);

it("both numbers of a curve are recorded, cleared with the world, and let go with the plot", () => {
  addXYPlot([{ x, y }]);
  expect(drawn()).toEqual({ x: [], y: [] });
  publish(1, { x: 5, y: 6 });
  publish(2, { x: 7, y: 8 });
  expect(drawn()).toEqual({ x: [5, 7], y: [6, 8] });

  useEpoch.setState({ epoch: 1, run: 0 }); // a moved playback: what is earlier stays
  expect(drawn().x).toEqual([5, 7]);
  useEpoch.setState({ epoch: 2, run: 1 }); // another world or log
  expect(drawn().x).toEqual([]);
  publish(3, { x: 1, y: 2 });
  publish(0, { x: 0, y: 0 }); // a reset
  expect(drawn()).toEqual({ x: [0], y: [0] });

  removePlot(usePlots.getState().plots.at(-1)!.id);
  expect(listeners.get("/uav1/odom")!.size).toBe(0);
});
