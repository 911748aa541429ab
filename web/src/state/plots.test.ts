// @vitest-environment happy-dom
import { beforeEach, expect, it } from "vitest";
import {
  addDistancePlot,
  addXYPlot,
  curveName,
  drawCurves,
  drawLine,
  hasEqualScales,
  linesOf,
  removeCurve,
  setDistances,
  setEqualScales,
  usePlots,
  type Curve,
  type XYPlot,
} from "./plots.ts";
import { restoreLayout, saveLayout } from "./savedLayouts.ts";

const ODOMETRY = "nav_msgs/msg/Odometry";
const of = (topic: string, path: string) => ({ topic, type: ODOMETRY, path });
const above = (uav: string): Curve => ({
  x: of(`/${uav}/odom`, "pose.pose.position.x"),
  y: of(`/${uav}/odom`, "pose.pose.position.y"),
});
const last = () => usePlots.getState().plots.at(-1) as XYPlot;

const height = of("/uav1/odom", "pose.pose.position.z");

beforeEach(() => usePlots.setState({ plots: [{ id: 1, lines: [height] }], windowS: 20 }));

it("a plot of positions has equal scales unless it is set otherwise", () => {
  addXYPlot([above("uav1")]);
  expect(hasEqualScales(last())).toBe(true);
  const speed = of("/uav1/odom", "twist.twist.linear.x");
  drawCurves(2, [{ x: above("uav1").x, y: speed }]);
  expect(hasEqualScales(last())).toBe(false);
  setEqualScales(2, true);
  expect(hasEqualScales(last())).toBe(true);
});

it("a plot of distances has no lines, replaces an empty plot, and keeps its own", () => {
  usePlots.setState({ plots: [{ id: 1, lines: [] }] });
  addDistancePlot();
  const distances = { id: 1, kind: "distances", of: "nearest" };
  expect(usePlots.getState().plots).toEqual([distances]);
  setDistances(1, "pairs");
  addXYPlot([]);
  expect(usePlots.getState().plots[0]).toEqual({ ...distances, of: "pairs" });
  expect(linesOf(usePlots.getState().plots[0]!)).toEqual([]);
  drawLine(height, 1); // nothing can be drawn there
  drawLine(height);
  expect(usePlots.getState().plots.map(({ kind }) => kind)).toEqual(["distances", "xy", undefined]);
});

it("a curve is drawn once, and its numbers are received once", () => {
  addXYPlot([above("uav1")]);
  drawCurves(2, [above("uav1"), above("uav2")]);
  drawCurves(2, [{ x: above("uav1").x, y: height }]);
  expect(last().curves).toHaveLength(3);
  expect(linesOf(last())).toHaveLength(5);
  removeCurve(2, above("uav2"));
  expect(last().curves.map(curveName)).toEqual([
    "/uav1/odom position.x, y",
    "/uav1/odom position.x, z",
  ]);
});

it("a line of a topic goes to a plot over time", () => {
  addXYPlot([above("uav1")]);
  drawLine(of("/uav1/odom", "pose.pose.position.x"));
  expect(usePlots.getState().plots[0]).toHaveProperty("lines.length", 2);
  usePlots.setState({ plots: [] });
  addXYPlot([]);
  drawLine(height);
  expect(usePlots.getState().plots.map(({ kind }) => kind ?? "time")).toEqual(["xy", "time"]);
});

it("x-y plots are saved in layouts", () => {
  addXYPlot([above("uav1")]);
  setEqualScales(2, false);
  const plots = usePlots.getState().plots;
  saveLayout("paths");
  usePlots.setState({ plots: [] });
  restoreLayout("paths");
  expect(usePlots.getState().plots).toEqual(plots);
});

it("an x-y plot replaces a plot that shows nothing", () => {
  usePlots.setState({ plots: [{ id: 1, lines: [] }] });
  addXYPlot([above("uav1")]);
  expect(usePlots.getState().plots.map(({ kind }) => kind)).toEqual(["xy"]);
});
