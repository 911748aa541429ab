import { NavLink, ScrollArea, Text } from "@mantine/core";
import { useState } from "react";
import { matcher } from "../../lib/filter.ts";
import { serviceNames } from "../../link/commands.ts";
import { FilterInput } from "../shared/FilterInput.tsx";
import { Reason } from "../shared/Reason.tsx";
import { useRequest } from "../shared/useRequest.ts";
import { ServiceCall } from "./ServiceCall.tsx";
import classes from "./Services.module.css";

const NONE: string[] = [];
const ASK_MS = 5000;
const MAX_SHOWN = 300;

/** Every service; a form made of its description calls it. */
export default function Services() {
  const { value: all, reason } = useRequest(serviceNames, NONE, ASK_MS);
  const [filter, setFilter] = useState("");
  const [chosen, setChosen] = useState("");
  const fitting = all.filter(matcher(filter));
  return (
    <div className={classes.panel} data-chosen={chosen !== "" || undefined}>
      <div className={classes.names}>
        <FilterInput
          label="Filter services"
          placeholder={`Filter ${all.length} services`}
          mx="xs"
          mb={4}
          value={filter}
          onChange={setFilter}
        />
        <Reason>{reason}</Reason>
        <ScrollArea flex={1} mih={0}>
          {fitting.slice(0, MAX_SHOWN).map((name) => (
            <NavLink
              key={name}
              component="button"
              className={classes.name}
              label={name}
              py={2}
              active={name === chosen}
              onClick={() => setChosen(name)}
            />
          ))}
        </ScrollArea>
      </div>
      <ScrollArea className={classes.call} type="auto">
        {chosen === "" ? (
          <Text size="sm" c="dimmed">
            Choose a service to call it.
          </Text>
        ) : (
          <ServiceCall key={chosen} service={chosen} />
        )}
      </ScrollArea>
    </div>
  );
}
