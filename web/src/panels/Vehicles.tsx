import { Badge, NavLink, ScrollArea } from "@mantine/core";
import { select, useVehicles } from "../state/vehicles.ts";

/** All UAVs; a click selects one. */
export default function Vehicles() {
  const { list, selected } = useVehicles();
  return (
    <ScrollArea h="100%">
      {list.map((vehicle) => (
        <NavLink
          key={vehicle.name}
          label={vehicle.name}
          description={vehicle.airframe}
          active={vehicle.name === selected}
          onClick={() => select(vehicle.name)}
          rightSection={<Badge variant="light">{vehicle.mode}</Badge>}
        />
      ))}
    </ScrollArea>
  );
}
