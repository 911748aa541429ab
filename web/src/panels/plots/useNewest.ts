import { useEffect, useState } from "react";
import { nameOf, type Line } from "../../state/plots.ts";
import { seriesOf } from "./recorder.ts";

const READ_MS = 250;

/** Reads the newest values of lines a few times a second; the key is their name. */
export function useNewest(lines: readonly Line[]): ReadonlyMap<string, number> {
  const [values, setValues] = useState<ReadonlyMap<string, number>>(new Map());
  useEffect(() => {
    const read = (line: Line): [string, number] => {
      const series = seriesOf(line);
      return [nameOf(line), series.length === 0 ? NaN : series.yAt(series.length - 1)];
    };
    const timer = setInterval(() => setValues(new Map(lines.map(read))), READ_MS);
    return () => clearInterval(timer);
  }, [lines]);
  return values;
}

/** A value for a legend; empty: there is none yet. */
export function numberText(value: number | undefined): string {
  return value === undefined || Number.isNaN(value) ? "" : value.toPrecision(5);
}
