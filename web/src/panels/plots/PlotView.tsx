import { ActionIcon, CloseButton, Group, Text, useComputedColorScheme } from "@mantine/core";
import { Download, Maximize2, X } from "lucide-react";
import { useEffect, useRef, useState } from "react";
import { minSpanOf } from "../../lib/plotRange.ts";
import { csvOf } from "../../lib/series.ts";
import { download } from "../../lib/download.ts";
import { nameOf, removeLine, removePlot, usePlots, type Plot } from "../../state/plots.ts";
import { AddLine } from "./AddLine.tsx";
import { colourOf } from "./colours.ts";
import { Drawing } from "./drawing.ts";
import classes from "./Plots.module.css";
import { presentS, seriesOf } from "./recorder.ts";

const DRAW_MS = 50;
const LOOKS = {
  light: { text: "#5c636a", grid: "#00000014" },
  dark: { text: "#a6adb4", grid: "#ffffff14" },
};

/** Lines over simulated time. */
export function PlotView({ plot, paused }: { plot: Plot; paused: boolean }) {
  const scheme = useComputedColorScheme();
  const place = useRef<HTMLDivElement>(null);
  const drawing = useRef<Drawing | null>(null);
  const still = useRef<number | null>(null);
  still.current = paused ? (still.current ?? presentS()) : null;
  const [values, setValues] = useState<number[]>([]);

  useEffect(() => {
    const element = place.current!;
    const lines = plot.lines.map((line, i) => ({
      name: nameOf(line),
      colour: colourOf(i),
      series: seriesOf(line),
      minSpan: minSpanOf(line.path),
    }));
    const made = new Drawing(element, lines, LOOKS[scheme]);
    drawing.current = made;
    const sized = new ResizeObserver(([entry]) => {
      if (entry) made.resize(entry.contentRect.width, entry.contentRect.height);
    });
    sized.observe(element);
    const timer = setInterval(() => {
      const to = still.current ?? presentS();
      made.draw(to - usePlots.getState().windowS, to);
    }, DRAW_MS);
    const telling = setInterval(
      () => setValues(lines.map(({ series }) => series.yAt(series.length - 1))),
      250,
    );
    return () => {
      clearInterval(timer);
      clearInterval(telling);
      sized.disconnect();
      made.destroy();
    };
  }, [plot.lines, scheme]);

  return (
    <section className={classes.plot} aria-label={`Plot ${plot.id}`}>
      <Group gap={4} wrap="nowrap" justify="space-between">
        <Group gap={8} className={classes.lines}>
          {plot.lines.map((line, i) => (
            <Group key={nameOf(line)} gap={2} wrap="nowrap">
              <span className={classes.mark} style={{ background: colourOf(i) }} />
              <Text size="xs" ff="monospace" data-line={nameOf(line)}>
                {nameOf(line)} {numberText(values[i])}
              </Text>
              <CloseButton
                size="xs"
                aria-label={`Remove ${nameOf(line)}`}
                onClick={() => removeLine(plot.id, line)}
              />
            </Group>
          ))}
        </Group>
        <Group gap={0} wrap="nowrap">
          <ActionIcon
            size="sm"
            variant="subtle"
            aria-label="Show the newest again"
            title="Show the newest again (double click)"
            onClick={() => drawing.current?.showNewest()}
          >
            <Maximize2 size={14} />
          </ActionIcon>
          <ActionIcon
            size="sm"
            variant="subtle"
            aria-label="Download as CSV"
            title="Download as CSV"
            disabled={plot.lines.length === 0}
            onClick={() => downloadPlot(plot)}
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
        <div ref={place} className={classes.canvas} />
        {plot.lines.length === 0 && (
          <Text className={classes.hint} size="sm" c="dimmed">
            Choose a topic below and one of its fields to draw a line.
          </Text>
        )}
      </div>
      <AddLine plot={plot.id} />
    </section>
  );
}

function downloadPlot({ id, lines }: Plot): void {
  download(`volery_plot_${id}.csv`, csvOf(lines.map(nameOf), lines.map(seriesOf)), "text/csv");
}

function numberText(value: number | undefined): string {
  return value === undefined || Number.isNaN(value) ? "" : value.toPrecision(5);
}
