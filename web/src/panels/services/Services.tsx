import { NavLink, ScrollArea, Text, TextInput } from "@mantine/core";
import { Search } from "lucide-react";
import { useState } from "react";
import { serviceNames } from "../../link/commands.ts";
import { Reason } from "../shared/Reason.tsx";
import { useAsked } from "../shared/useAsked.ts";
import { ServiceCall } from "./ServiceCall.tsx";
import classes from "./Services.module.css";

const NONE: string[] = [];
const ASK_MS = 5000;
const MOST_SHOWN = 300;

/** Every service; a form made of its description calls it. */
export default function Services() {
  const { value: all, reason } = useAsked(serviceNames, NONE, ASK_MS);
  const [sought, setSought] = useState("");
  const [chosen, setChosen] = useState("");
  const words = sought.toLowerCase().split(/\s+/);
  const fitting = all.filter((name) => words.every((word) => name.toLowerCase().includes(word)));
  return (
    <div className={classes.panel} data-chosen={chosen !== "" || undefined}>
      <div className={classes.names}>
        <TextInput
          size="xs"
          mx="xs"
          mb={4}
          leftSection={<Search size={14} />}
          placeholder={`Filter ${all.length} services`}
          aria-label="Filter services"
          value={sought}
          onChange={(event) => setSought(event.currentTarget.value)}
        />
        <Reason>{reason}</Reason>
        <ScrollArea flex={1} mih={0}>
          {fitting.slice(0, MOST_SHOWN).map((name) => (
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
