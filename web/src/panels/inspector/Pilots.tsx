import { Text } from "@mantine/core";
import { useVehicles } from "../../state/vehicles.ts";
import { Section } from "./Section.tsx";

/** Who steers this UAV. */
export function Pilots({ uav }: { uav: string }) {
  const holder = useVehicles(({ list }) => list.find(({ name }) => name === uav)?.holder ?? "");
  return (
    <Section title="Control">
      <Text size="sm" aria-label="Holder">
        {holder === "" ? "Nobody has taken the control: every pilot may command it." : holder}
      </Text>
    </Section>
  );
}
