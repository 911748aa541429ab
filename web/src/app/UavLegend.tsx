import { uavColour, type Colouring } from "../lib/uavColours.ts";
import { useColouring } from "../state/colouring.ts";
import { useVehicles } from "../state/vehicles.ts";

const MAX_TYPES = 8;

/** What the colours of UAVs mean; nothing while each has its own one. */
export function UavLegend() {
  const { by, top, types } = useColouring();
  const flying = useVehicles(({ list }) => list.length > 0);
  if (by === "uav" || !flying) return null;
  return (
    <div className="legend" role="note" aria-label="Colours of UAVs">
      {by === "type" ? <Types types={types} /> : <Scale by={by} top={top} />}
    </div>
  );
}

function Scale({ by, top }: { by: Exclude<Colouring, "uav" | "type">; top: number }) {
  const unit = { speed: "m/s", height: "m", battery: "%" }[by];
  return (
    <span>
      UAVs, {by} 0 {unit}
      <span
        className="turbo"
        style={by === "battery" ? {} : { transform: "scaleX(-1)" }}
        aria-hidden
      />
      {by === "battery" ? 100 : top} {unit}
    </span>
  );
}

function Types({ types }: { types: readonly string[] }) {
  const left = types.length - MAX_TYPES;
  return (
    <>
      {types.slice(0, MAX_TYPES).map((type) => (
        <span key={type}>
          <span className="legend-dot" style={{ background: cssOf(type, types) }} aria-hidden />
          {type}
        </span>
      ))}
      {left > 0 && <span>and {left} more</span>}
    </>
  );
}

function cssOf(type: string, types: readonly string[]): string {
  const at = { x: 0, y: 0, z: 0 };
  const uav = { type, airframe: type, battery: NaN, position: at, velocity: at };
  return `rgb(${uavColour(uav, "type", 1, types).join(" ")})`;
}
