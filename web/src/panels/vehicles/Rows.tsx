import { Badge, Text } from "@mantine/core";
import { memo, useEffect, useMemo, useRef, useState, type KeyboardEvent } from "react";
import type { volery_interfaces_VehicleState as VehicleState } from "../../messages/generated.ts";
import { faultText } from "../../lib/activeFaults.ts";
import { useFaults } from "../../state/faults.ts";
import { batteryColour, colourOf, modeText } from "./modes.ts";

const ROW_PX = 44;
/** Rows beside what is seen, so that scrolling finds them there. */
const SPARE = 6;

/** `more`: beside what is selected. */
export type Choice = "alone" | "more";

interface RowsProps {
  list: VehicleState[];
  selected: string;
  group: readonly string[];
  choose: (name: string, how: Choice) => void;
  /** Of the UAV that is clicked twice. */
  open: () => void;
}

/** Rows of hundreds of UAVs, of which those are made that are seen. */
export function Rows({ list, selected, group, choose, open }: RowsProps) {
  const together = useMemo(() => new Set(group), [group]);
  const box = useRef<HTMLDivElement>(null);
  const [top, setTop] = useState(0);
  const height = box.current?.clientHeight ?? 600;
  const first = Math.max(0, Math.floor(top / ROW_PX) - SPARE);
  const last = Math.min(list.length, Math.ceil((top + height) / ROW_PX) + SPARE);
  const at = list.findIndex(({ name }) => name === selected);
  useEffect(() => {
    const element = box.current;
    if (element === null || at < 0) return;
    const [above, below] = [at * ROW_PX, (at + 1) * ROW_PX];
    if (above < element.scrollTop) element.scrollTop = above;
    else if (below > element.scrollTop + element.clientHeight) {
      element.scrollTop = below - element.clientHeight;
    }
  }, [at]);
  const key = (event: KeyboardEvent) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    const next = step === undefined ? undefined : list[at + step];
    if (event.key === "Enter") open();
    if (next === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    choose(next.name, "alone");
  };
  return (
    <div
      ref={box}
      className="rows"
      role="listbox"
      tabIndex={0}
      aria-multiselectable
      aria-label="UAVs"
      aria-activedescendant={at < 0 ? undefined : `uav-${selected}`}
      onScroll={(event) => setTop(event.currentTarget.scrollTop)}
      onKeyDown={key}
      onDoubleClick={open}
    >
      <div style={{ height: list.length * ROW_PX, position: "relative" }}>
        {list.slice(first, last).map((vehicle, i) => (
          <Row
            key={vehicle.name}
            vehicle={vehicle}
            top={(first + i) * ROW_PX}
            selected={vehicle.name === selected || together.has(vehicle.name)}
            choose={choose}
          />
        ))}
      </div>
    </div>
  );
}

interface RowProps {
  vehicle: VehicleState;
  top: number;
  selected: boolean;
  choose: (name: string, how: Choice) => void;
}

const Row = memo(function Row({ vehicle, top, selected, choose }: RowProps) {
  const { name, airframe, mode, operator, battery } = vehicle;
  return (
    <div
      id={`uav-${name}`}
      className="row"
      role="option"
      aria-selected={selected}
      style={{ top, height: ROW_PX }}
      onClick={(event) => choose(name, event.ctrlKey || event.metaKey ? "more" : "alone")}
    >
      <div className="row-name">
        <Text size="sm" fw={600} truncate>
          {name}
        </Text>
        <Text size="xs" c="dimmed" truncate>
          {operator === "" ? airframe : `${airframe} · ${operator}`}
        </Text>
      </div>
      <FaultBadge uav={name} />
      {Number.isFinite(battery) && (
        <Text size="xs" ff="monospace" c={batteryColour(battery)}>
          {Math.round(100 * battery)} %
        </Text>
      )}
      <Badge size="sm" variant="light" tt="none" maw="45%" color={colourOf(mode)}>
        {modeText(mode)}
      </Badge>
    </div>
  );
}, isSame);

/** How many faults a UAV has, and which. */
function FaultBadge({ uav }: { uav: string }) {
  const active = useFaults((faults) => faults.active);
  const own = active.filter((fault) => fault.uav === uav);
  if (own.length === 0) return null;
  const text = own.map(faultText).join(", ");
  return (
    <Badge
      size="sm"
      variant="light"
      tt="none"
      color="red"
      title={text}
      aria-label={`Fault: ${text}`}
    >
      {own.length === 1 ? "fault" : `${own.length} faults`}
    </Badge>
  );
}

/** Only what a row shows counts: positions change with every message. */
function isSame(a: RowProps, b: RowProps): boolean {
  const [v, w] = [a.vehicle, b.vehicle];
  return (
    a.top === b.top &&
    a.selected === b.selected &&
    a.choose === b.choose &&
    v.name === w.name &&
    v.airframe === w.airframe &&
    v.mode === w.mode &&
    v.operator === w.operator &&
    Object.is(Math.round(100 * v.battery), Math.round(100 * w.battery))
  );
}
