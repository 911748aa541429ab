import { Badge, Group, ScrollArea, Select, Stack, Text } from "@mantine/core";
import { select, useVehicleNames, useVehicles } from "../../state/vehicles.ts";
import { colourOf, modeText } from "../vehicles/modes.ts";
import { Attitude } from "./Attitude.tsx";
import { Figures } from "./Figures.tsx";
import { GoTo } from "./GoTo.tsx";
import { FlightCommands } from "./FlightCommands.tsx";
import { ControlAuthority } from "./ControlAuthority.tsx";
import { GroupCommands } from "./GroupCommands.tsx";
import { Removal } from "./Removal.tsx";
import { Repair } from "./Repair.tsx";
import { Sensors } from "./Sensors.tsx";

/** Names that the list shows at a time; typing finds others. */
const MAX_SHOWN = 200;

/** The selected UAV: state, sensors and commands. */
export default function Inspector() {
  const names = useVehicleNames();
  const selected = useVehicles((vehicles) => vehicles.selected);
  const group = useVehicles((vehicles) => vehicles.group);
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
            data={names}
            limit={MAX_SHOWN}
            value={selected}
            searchable
            allowDeselect={false}
            onChange={(name) => name !== null && select(name)}
          />
          <Mode />
        </Group>
        <Repair key={`repair ${selected}`} uav={selected} />
        {group.length > 0 ? (
          <GroupCommands uavs={group} />
        ) : (
          <FlightCommands key={`commands ${selected}`} uavs={[selected]} />
        )}
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
