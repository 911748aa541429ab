import { Autocomplete, Button, Group, Text, TextInput } from "@mantine/core";
import { useState } from "react";
import { handOver, releaseControl } from "../../link/commands.ts";
import { useConnection } from "../../state/connection.ts";
import { succeeds } from "../../state/notices.ts";
import { setOperatorName, take, useOperator, useOtherOperator } from "../../state/operator.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useVehicles } from "../../state/vehicles.ts";
import { Section } from "./Section.tsx";

/** The operator of this UAV: take control, release it, hand it over. */
export function ControlAuthority({ uav }: { uav: string }) {
  const operator = useVehicles(({ list }) => list.find(({ name }) => name === uav)?.operator ?? "");
  const other = useOtherOperator(uav);
  const volery = useConnection((connection) => connection.volery);
  if (!volery) return null;
  return (
    <Section title="Control">
      <Text size="sm" aria-label="Operator" c={other === "" ? "bright" : "orange"}>
        {operator === ""
          ? "No operator: every authorized client may command this UAV."
          : other === ""
            ? `You control this UAV as ${operator}.`
            : `${operator} controls this UAV: the server refuses your commands.`}
      </Text>
      {operator === "" && <Take uav={uav} />}
      {operator !== "" && other === "" && <Held uav={uav} />}
    </Section>
  );
}

function Take({ uav }: { uav: string }) {
  const wished = useOperator((operator) => operator.wished);
  const whyNot = useWhyNot();
  return (
    <Group gap={6} wrap="nowrap">
      <TextInput
        size="xs"
        flex={1}
        aria-label="Your name"
        placeholder="Your name"
        maxLength={40}
        value={wished}
        onChange={(event) => setOperatorName(event.currentTarget.value)}
      />
      <Button
        size="xs"
        variant="light"
        disabled={whyNot !== null}
        onClick={() => void succeeds("Take control", take(uav))}
      >
        Take control
      </Button>
    </Group>
  );
}

function Held({ uav }: { uav: string }) {
  const others = useVehicles(({ list }) => list.map(({ operator }) => operator).join("\n"));
  const own = useOperator(({ name }) => name);
  const whyNot = useWhyNot();
  const [to, setTo] = useState("");
  const known = [...new Set(others.split("\n"))].filter((name) => name !== "" && name !== own);
  return (
    <>
      <Button
        size="xs"
        variant="light"
        disabled={whyNot !== null}
        onClick={() => void succeeds("Release control", releaseControl(uav))}
      >
        Release control
      </Button>
      <Group gap={6} wrap="nowrap">
        <Autocomplete
          size="xs"
          flex={1}
          aria-label="New operator"
          placeholder="Name of the new operator"
          data={known}
          value={to}
          onChange={setTo}
        />
        <Button
          size="xs"
          variant="default"
          disabled={whyNot !== null || to === ""}
          onClick={() => void succeeds("Hand over", handOver(uav, to))}
        >
          Hand over
        </Button>
      </Group>
    </>
  );
}
