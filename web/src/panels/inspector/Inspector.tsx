import { Badge, Group, ScrollArea, Select, Stack, Text } from "@mantine/core";
import { select, useVehicles } from "../../state/vehicles.ts";
import { colourOf, modeText } from "../vehicles/modes.ts";
import { Attitude } from "./Attitude.tsx";
import { Figures } from "./Figures.tsx";
import { GoTo } from "./GoTo.tsx";
import { FlightCommands } from "./FlightCommands.tsx";
import { ControlAuthority } from "./ControlAuthority.tsx";
import { Removal } from "./Removal.tsx";
import { Repair } from "./Repair.tsx";
import { Sensors } from "./Sensors.tsx";

/** The selected UAV: state, sensors and commands. */
export default function Inspector() {
  const names = useVehicles(({ list }) => list.map(({ name }) => name).join(" "));
  const selected = useVehicles((vehicles) => vehicles.selected);
  const known = useVehicles(({ list }) => list.some(({ name }) => name === selected));
  if (!known) {
    return (
      <Text p="sm" c="dimmed">
        No UAV is selected.
      </Text>
    );
  }
  return (
    <ScrollArea h="100%" type="auto">
      <Stack gap="sm" px="sm" pb="md">
        <Group gap="xs" wrap="nowrap">
          <Select
            flex={1}
            aria-label="Selected UAV"
            data={names.split(" ")}
            value={selected}
            searchable
            allowDeselect={false}
            onChange={(name) => name !== null && select(name)}
          />
          <Mode />
        </Group>
        <Repair key={`repair ${selected}`} uav={selected} />
        <FlightCommands key={`commands ${selected}`} uav={selected} />
        <Attitude key={`attitude ${selected}`} uav={selected} />
        <Figures />
        <GoTo key={selected} uav={selected} />
        <ControlAuthority uav={selected} />
        <Sensors key={`sensors ${selected}`} uav={selected} />
        <Removal uav={selected} />
      </Stack>
    </ScrollArea>
  );
}

function Mode() {
  const mode = useVehicles(
    ({ list, selected }) => list.find(({ name }) => name === selected)?.mode ?? "",
  );
  return (
    <Badge size="lg" variant="light" tt="none" color={colourOf(mode)} aria-label="Mode">
      {modeText(mode)}
    </Badge>
  );
}
