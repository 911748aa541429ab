import { ActionIcon, Button, Group, Text, UnstyledButton } from "@mantine/core";
import { ChartLine, ChevronDown, ChevronRight } from "lucide-react";
import { useState } from "react";
import { join, numberOf, parsed } from "../../lib/fieldPath.ts";
import classes from "./ValueTree.module.css";

const PAGE = 40;

interface ValueTreeProps {
  value: unknown;
  /** Called with the path of a number that is to be drawn; left out: nothing can be. */
  onPlot?: ((path: string) => void) | undefined;
}

/** A message as a tree that unfolds; branches that are closed are not made. */
export function ValueTree({ value, onPlot }: ValueTreeProps) {
  return (
    <div className={classes.tree} role="tree">
      <Children value={value} path="" onPlot={onPlot} />
    </div>
  );
}

interface BranchProps extends ValueTreeProps {
  path: string;
}

function Children({ value, path, onPlot }: BranchProps) {
  const [shown, setShown] = useState(PAGE);
  const entries = entriesOf(value, shown);
  const left = sizeOf(value) - entries.length;
  return (
    <>
      {entries.map(([step, inner]) => (
        <Entry key={step} step={step} value={inner} path={join(path, step)} onPlot={onPlot} />
      ))}
      {left > 0 && (
        <Button size="compact-xs" variant="subtle" onClick={() => setShown(shown + 5 * PAGE)}>
          {left} more
        </Button>
      )}
    </>
  );
}

interface EntryProps extends BranchProps {
  step: string | number;
}

function Entry({ step, value: raw, path, onPlot }: EntryProps) {
  const value = parsed(raw);
  const branch = value !== null && typeof value === "object";
  return branch ? (
    <Branch step={step} value={value} path={path} onPlot={onPlot} />
  ) : (
    <Group gap={6} wrap="nowrap" className={classes.leaf} role="treeitem">
      <Text span className={classes.name}>
        {step}
      </Text>
      <Text span className={classes.value} data-path={path}>
        {leafText(value)}
      </Text>
      {onPlot !== undefined && !Number.isNaN(numberOf(value)) && (
        <ActionIcon
          size="xs"
          variant="subtle"
          aria-label={`Plot ${path}`}
          title={`Plot ${path}`}
          onClick={() => onPlot(path)}
        >
          <ChartLine size={13} />
        </ActionIcon>
      )}
    </Group>
  );
}

function Branch({ step, value, path, onPlot }: EntryProps) {
  const size = sizeOf(value);
  const array = isArray(value);
  const [open, setOpen] = useState(!array);
  return (
    <div role="treeitem" aria-expanded={open}>
      <UnstyledButton className={classes.branch} onClick={() => setOpen(!open)} aria-label={path}>
        {open ? <ChevronDown size={13} /> : <ChevronRight size={13} />}
        <span className={classes.name}>{step}</span>
        {(array || !open) && <span className={classes.hint}>{array ? `[${size}]` : "…"}</span>}
      </UnstyledButton>
      {open && (
        <div className={classes.inner} role="group">
          <Children value={value} path={path} onPlot={onPlot} />
        </div>
      )}
    </div>
  );
}

function isArray(value: unknown): value is ArrayLike<unknown> {
  return Array.isArray(value) || (ArrayBuffer.isView(value) && !(value instanceof DataView));
}

function sizeOf(value: unknown): number {
  if (isArray(value)) return value.length;
  return value !== null && typeof value === "object" ? Object.keys(value).length : 0;
}

function entriesOf(value: unknown, count: number): [string | number, unknown][] {
  if (isArray(value)) {
    return Array.from({ length: Math.min(count, value.length) }, (_, i) => [i, value[i]]);
  }
  return value !== null && typeof value === "object" ? Object.entries(value).slice(0, count) : [];
}

function leafText(value: unknown): string {
  if (typeof value === "number") {
    if (Number.isInteger(value)) return String(value);
    const size = Math.abs(value);
    return size >= 1e6 || size < 1e-4 ? value.toExponential(4) : value.toFixed(5);
  }
  if (typeof value === "string") return value === "" ? '""' : value;
  return value === null ? "NaN" : String(value);
}
