import { ActionIcon, Button, Group, Text, Tooltip } from "@mantine/core";
import { Plus } from "lucide-react";
import { useCallback, useState } from "react";
import { counted } from "../../lib/counted.ts";
import { openPanel } from "../../state/layout.ts";
import { useConnection } from "../../state/connection.ts";
import { select, selectGroup, toggleSelected, useVehicles } from "../../state/vehicles.ts";
import { FilterInput } from "../shared/FilterInput.tsx";
import { Rows, type Choice } from "./Rows.tsx";
import { Spawn } from "./Spawn.tsx";

const SEARCH_FROM = 12;

/** All UAVs; a click selects one, and they come and go here. */
export default function Vehicles() {
  const list = useVehicles((vehicles) => vehicles.list);
  const selected = useVehicles((vehicles) => vehicles.selected);
  const volery = useConnection((connection) => connection.volery);
  const [filter, setFilter] = useState("");
  const [spawning, setSpawning] = useState(false);
  const group = useVehicles((vehicles) => vehicles.group);
  const sought = filter.toLowerCase();
  const shown =
    sought === ""
      ? list
      : list.filter(({ name, airframe, mode }) =>
          `${name} ${airframe} ${mode}`.toLowerCase().includes(sought),
        );
  const choose = useCallback(
    (name: string, how: Choice) => (how === "more" ? toggleSelected : select)(name),
    [],
  );
  return (
    <div className="column">
      <Group px="sm" pb={6} gap="xs" justify="space-between" wrap="nowrap">
        <Text size="sm" c="dimmed" aria-label="Number of UAVs">
          {counted(list.length, "UAV")}
          {group.length > 0 && `, ${group.length} selected`}
        </Text>
        {list.length > 1 && (
          <Button
            size="compact-xs"
            variant="subtle"
            ml="auto"
            disabled={shown.length === 0}
            onClick={() => selectGroup(shown.map(({ name }) => name))}
          >
            {sought === "" ? "Select all" : `Select ${shown.length}`}
          </Button>
        )}
        {volery && (
          <Tooltip label="Add UAVs">
            <ActionIcon
              variant={spawning ? "filled" : "light"}
              aria-label="Add UAVs"
              aria-expanded={spawning}
              onClick={() => setSpawning(!spawning)}
            >
              <Plus size={16} />
            </ActionIcon>
          </Tooltip>
        )}
      </Group>
      {spawning && <Spawn close={() => setSpawning(false)} />}
      {list.length >= SEARCH_FROM && (
        <FilterInput
          label="Search UAVs"
          placeholder="Search"
          mx="sm"
          mb={6}
          value={filter}
          onChange={setFilter}
        />
      )}
      <Rows list={shown} selected={selected} group={group} choose={choose} open={inspect} />
    </div>
  );
}

function inspect(): void {
  openPanel("right", "inspector");
}
