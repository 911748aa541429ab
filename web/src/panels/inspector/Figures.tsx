import { Progress, Text } from "@mantine/core";
import type { ReactNode } from "react";
import { eulerOf } from "../../lib/pose.ts";
import { spanText } from "../../lib/time.ts";
import { link } from "../../link/link.ts";
import type { volery_interfaces_VehicleState as VehicleState } from "../../messages/generated.ts";
import { baseFrame, useVehicles } from "../../state/vehicles.ts";
import { heightAt } from "../../state/worldPlan.ts";
import { batteryColour } from "../vehicles/modes.ts";

/** Numbers of the selected UAV, as often as the vehicles are published. */
export function Figures() {
  const vehicle = useVehicles(({ list, selected }) => list.find(({ name }) => name === selected));
  if (vehicle === undefined) return null;
  const { position: p, velocity: v } = vehicle;
  return (
    <dl className="figures">
      <Figure name="Position" unit="m">
        {[p.x, p.y, p.z].map(decimal).join("  ")}
      </Figure>
      <Figure name="Above ground" unit="m">
        {decimal(p.z - heightAt(p.x, p.y))}
      </Figure>
      <Figure name="Speed" unit="m/s">
        {decimal(Math.hypot(v.x, v.y, v.z))}
      </Figure>
      <Figure name="Climb" unit="m/s">
        {decimal(v.z)}
      </Figure>
      <Heading name={vehicle.name} />
      <Battery vehicle={vehicle} />
      <Figure name="Last command" unit="">
        {vehicle.command_age < 0 ? "none from clients" : `${spanText(vehicle.command_age)} ago`}
      </Figure>
      <Figure name="Airframe" unit="">
        {vehicle.airframe}
      </Figure>
    </dl>
  );
}

interface FigureProps {
  name: string;
  unit: string;
  children: ReactNode;
}

function Figure({ name, unit, children }: FigureProps) {
  return (
    <div>
      <dt>{name}</dt>
      <dd aria-label={name}>
        {children}{" "}
        <Text span size="xs" c="dimmed">
          {unit}
        </Text>
      </dd>
    </div>
  );
}

/** Counter-clockwise from the map's x axis, as in REP-103. */
function Heading({ name }: { name: string }) {
  const pose = link.frames.pose(baseFrame(name));
  const yaw = pose === null ? NaN : eulerOf(pose[3], pose[4], pose[5], pose[6]).yaw;
  return (
    <Figure name="Heading" unit="°, east 0, north 90">
      {Number.isNaN(yaw) ? "–" : String(Math.round((yaw * 180) / Math.PI) + 0)}
    </Figure>
  );
}

function Battery({ vehicle: { battery, voltage } }: { vehicle: VehicleState }) {
  if (!Number.isFinite(battery)) {
    return (
      <Figure name="Battery" unit="">
        not modelled
      </Figure>
    );
  }
  return (
    <div>
      <dt>Battery</dt>
      <dd aria-label="Battery">
        {Math.round(100 * battery)} % {Number.isFinite(voltage) && `(${voltage.toFixed(1)} V)`}
        <Progress
          mt={2}
          size="xs"
          value={100 * battery}
          color={batteryColour(battery)}
          aria-label="Battery"
        />
      </dd>
    </div>
  );
}

function decimal(value: number): string {
  if (Number.isNaN(value)) return "–";
  return (Object.is(value.toFixed(2), "-0.00") ? 0 : value).toFixed(2);
}
