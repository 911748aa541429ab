import { ActionIcon, Group, Text, Tooltip } from "@mantine/core";
import { Plus } from "lucide-react";
import { useState } from "react";
import { counted } from "../../lib/counted.ts";
import { openPanel } from "../../state/layout.ts";
import { useConnection } from "../../state/connection.ts";
import { select, useVehicles } from "../../state/vehicles.ts";
import { FilterInput } from "../shared/FilterInput.tsx";
import { Rows } from "./Rows.tsx";
import { Spawn } from "./Spawn.tsx";

const SEARCH_FROM = 12;

/** All UAVs; a click selects one, and they come and go here. */
export default function Vehicles() {
  const list = useVehicles((vehicles) => vehicles.list);
  const selected = useVehicles((vehicles) => vehicles.selected);
  const volery = useConnection((connection) => connection.volery);
  const [filter, setFilter] = useState("");
  const [spawning, setSpawning] = useState(false);
  const shown = list.filter(({ name, airframe, mode }) =>
    `${name} ${airframe} ${mode}`.toLowerCase().includes(filter.toLowerCase()),
  );
  return (
    <div className="column">
      <Group px="sm" pb={6} gap="xs" justify="space-between" wrap="nowrap">
        <Text size="sm" c="dimmed" aria-label="Number of UAVs">
          {counted(list.length, "UAV")}
        </Text>
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
      <Rows list={shown} selected={selected} choose={select} open={inspect} />
    </div>
  );
}

function inspect(): void {
  openPanel("right", "inspector");
}
