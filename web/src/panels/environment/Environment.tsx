import { Alert, ScrollArea, Stack } from "@mantine/core";
import { useWhyNot } from "../../state/rights.ts";
import { Section } from "../inspector/Section.tsx";
import { Blocks } from "./Blocks.tsx";
import { FieldDials } from "./FieldDials.tsx";
import { Trees } from "./Trees.tsx";
import { useWeather } from "./useWeather.ts";
import { LIGHT, PRECIPITATION, VISIBILITY } from "./weatherFields.ts";
import { WindDials } from "./WindDials.tsx";

/** Wind, weather, hour of day, and the obstacles of the world. */
export default function Environment() {
  const { weather, change, problem } = useWeather();
  const whyNot = useWhyNot();
  const disabled = whyNot !== null;
  const dials = { values: weather, change, disabled };
  return (
    <ScrollArea h="100%" type="auto">
      <Stack gap="sm" px="sm" pb="md">
        {whyNot !== null && <Alert p="xs">{whyNot}</Alert>}
        {problem !== "" && (
          <Alert color="yellow" p="xs">
            {problem}
          </Alert>
        )}
        <WindDials weather={weather} change={change} disabled={disabled} />
        <Section title="Weather">
          <FieldDials fields={PRECIPITATION} {...dials} />
          <FieldDials fields={VISIBILITY} {...dials} />
        </Section>
        <Section title="Light">
          <FieldDials fields={LIGHT} {...dials} />
        </Section>
        <Blocks />
        <Trees />
      </Stack>
    </ScrollArea>
  );
}
