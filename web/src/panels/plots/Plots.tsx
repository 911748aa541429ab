import "uplot/dist/uPlot.min.css";
import { Button, Group, Select } from "@mantine/core";
import { Pause, Play, Plus } from "lucide-react";
import { useState } from "react";
import { addPlot, setWindow, usePlots } from "../../state/plots.ts";
import { PlotView } from "./PlotView.tsx";
import classes from "./Plots.module.css";

const WINDOWS_S = [5, 10, 20, 60, 300];

/** Numbers of messages as lines over simulated time. */
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
          {paused ? "Go on" : "Hold plots"}
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
          Plot
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
