import "uplot/dist/uPlot.min.css";
import { Button, Group, Select } from "@mantine/core";
import { Pause, Play, Plus } from "lucide-react";
import { useState } from "react";
import { positionCurve } from "../../lib/usualCurves.ts";
import {
  addDistancePlot,
  addPlot,
  addXYPlot,
  setWindow,
  usePlots,
  type Plot,
} from "../../state/plots.ts";
import { useTopics } from "../../state/topics.ts";
import { useVehicles } from "../../state/vehicles.ts";
import classes from "./Plots.module.css";
import { DistancePlotView } from "./DistancePlotView.tsx";
import { TimePlotView } from "./TimePlotView.tsx";
import { XYPlotView } from "./XYPlotView.tsx";

const WINDOWS_S = [5, 10, 20, 60, 300, 1800];

/** Numbers of messages over simulated time, or over each other. */
export default function Plots() {
  const { plots, windowS } = usePlots();
  const [paused, setPaused] = useState(false);
  return (
    <div className={classes.panel}>
      <Group gap="xs" px="sm" pb={4}>
        <Button
          size="compact-xs"
          variant="default"
          leftSection={paused ? <Play size={13} /> : <Pause size={13} />}
          onClick={() => setPaused(!paused)}
        >
          {paused ? "Resume plots" : "Freeze plots"}
        </Button>
        <Select
          size="xs"
          w={110}
          aria-label="Time window"
          data={WINDOWS_S.map((s) => ({
            value: String(s),
            label: s < 60 ? `${s} s` : `${s / 60} min`,
          }))}
          value={String(windowS)}
          allowDeselect={false}
          onChange={(value) => setWindow(Number(value))}
        />
        <Button
          size="compact-xs"
          variant="default"
          leftSection={<Plus size={13} />}
          onClick={addPlot}
        >
          Time plot
        </Button>
        <Button
          size="compact-xs"
          variant="default"
          leftSection={<Plus size={13} />}
          title="One field against another; starts with the ground track of the selected UAV"
          onClick={beginXYPlot}
        >
          x-y plot
        </Button>
        <Button
          size="compact-xs"
          variant="default"
          leftSection={<Plus size={13} />}
          title="How the distances between UAVs are distributed now"
          onClick={addDistancePlot}
        >
          Distances
        </Button>
      </Group>
      <div className={classes.plots}>
        {plots.map((plot) => (
          <PlotView key={plot.id} plot={plot} paused={paused} />
        ))}
      </div>
    </div>
  );
}

function PlotView({ plot, paused }: { plot: Plot; paused: boolean }) {
  switch (plot.kind) {
    case "xy":
      return <XYPlotView plot={plot} paused={paused} />;
    case "distances":
      return <DistancePlotView plot={plot} paused={paused} />;
    default:
      return <TimePlotView plot={plot} paused={paused} />;
  }
}

function beginXYPlot(): void {
  addXYPlot(positionCurve(useTopics.getState().list, useVehicles.getState().selected));
}
