import { ActionIcon, CloseButton, Group, Text } from "@mantine/core";
import { Download, Maximize2, X } from "lucide-react";
import type { ReactNode } from "react";
import { csvOf } from "../../lib/series.ts";
import { download } from "../../lib/download.ts";
import { linesOf, nameOf, removePlot, type Plot } from "../../state/plots.ts";
import classes from "./Plots.module.css";
import { seriesOf } from "./recorder.ts";
import type { Drawn } from "./useDrawing.ts";

export interface LegendEntry {
  name: string;
  /** The whole name, where `name` is a shorter one. */
  title?: string;
  colour: string;
  /** What it is at present. */
  value: string;
  /** Left out: it goes with its plot. */
  remove?: () => void;
}

interface PlotFrameProps {
  plot: Plot;
  drawn: Drawn;
  legend: readonly LegendEntry[];
  /** What an empty plot says. */
  hint: string;
  /** What is saved; left out: the points of all lines. */
  csv?: () => string;
  /** Buttons of this sort of plot. */
  actions?: ReactNode;
  /** Below the drawing: what adds to it. */
  children?: ReactNode;
}

/** Legend, buttons and room of a plot. */
export function PlotFrame(props: PlotFrameProps) {
  const { plot, drawn, legend, hint, csv = () => csvOfLines(plot), actions, children } = props;
  return (
    <section className={classes.plot} aria-label={`Plot ${plot.id}`}>
      <Group gap={4} wrap="nowrap" justify="space-between" align="start">
        <div className={classes.legend}>
          {legend.map((entry) => (
            <Entry key={entry.title ?? entry.name} {...entry} />
          ))}
        </div>
        <Group gap={0} wrap="nowrap">
          {actions}
          <ActionIcon
            size="sm"
            variant="subtle"
            aria-label="Show the newest data"
            title="Show the newest data (double click)"
            onClick={drawn.showNewest}
          >
            <Maximize2 size={14} />
          </ActionIcon>
          <ActionIcon
            size="sm"
            variant="subtle"
            aria-label="Download as CSV"
            title="Download as CSV"
            disabled={legend.length === 0}
            onClick={() => download(`volery_plot_${plot.id}.csv`, csv(), "text/csv")}
          >
            <Download size={14} />
          </ActionIcon>
          <ActionIcon
            size="sm"
            variant="subtle"
            aria-label={`Remove plot ${plot.id}`}
            title="Remove"
            onClick={() => removePlot(plot.id)}
          >
            <X size={14} />
          </ActionIcon>
        </Group>
      </Group>
      <div className={classes.field}>
        <div
          ref={drawn.container}
          className={classes.canvas}
          data-empty={legend.length === 0 || undefined}
        />
        {legend.length === 0 && (
          <Text className={classes.hint} size="sm" c="dimmed">
            {hint}
          </Text>
        )}
      </div>
      {children}
    </section>
  );
}

function Entry({ name, title, colour, value, remove }: LegendEntry) {
  return (
    <Group gap={2} wrap="nowrap" maw="100%">
      <span className={classes.mark} style={{ background: colour }} />
      <Text size="xs" ff="monospace" truncate data-line={title ?? name} title={title}>
        {name} {value}
      </Text>
      {remove !== undefined && (
        <CloseButton size="xs" aria-label={`Remove ${title ?? name}`} onClick={remove} />
      )}
    </Group>
  );
}

function csvOfLines(plot: Plot): string {
  const lines = linesOf(plot);
  return csvOf(lines.map(nameOf), lines.map(seriesOf));
}
