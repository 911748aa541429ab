import {
  Button,
  Checkbox,
  Code,
  NumberInput,
  Select,
  SimpleGrid,
  Stack,
  Text,
} from "@mantine/core";
import { ArrowLeft, Play } from "lucide-react";
import { useEffect, useState } from "react";
import {
  choices,
  loadScenario,
  type Choices,
  type ScenarioCard,
  type ScenarioChanges,
} from "../../link/commands.ts";
import { succeeds } from "../../state/notices.ts";
import { useWhyNotOpen } from "../../state/rights.ts";
import { closeWindow } from "../../state/windows.ts";
import { sensorSetsOf } from "./sensorSets.ts";
import { SubmitRow } from "./SubmitRow.tsx";

const MAX_UAVS = 10_000;

/** How a scenario is to be flown. What is left as it is is not sent to the server. */
export function Start({ card, back }: { card: ScenarioCard; back: () => void }) {
  const offered = useChoices();
  const whyNot = useWhyNotOpen();
  const [changes, setChanges] = useState<ScenarioChanges>({});
  const [busy, setBusy] = useState(false);
  const change = (next: ScenarioChanges) => setChanges({ ...changes, ...next });
  const start = async () => {
    setBusy(true);
    const done = await succeeds(`Start ${card.name}`, loadScenario(card.name, changes));
    setBusy(false);
    if (done) closeWindow();
  };
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        void start();
      }}
    >
      <Stack gap="sm">
        <Text size="sm">{card.description}</Text>
        {card.missing !== "" && (
          <Text size="sm" c="orange" role="alert" className="reason">
            {card.missing}
          </Text>
        )}
        <SimpleGrid cols={{ base: 1, xs: 2 }} spacing="sm">
          <NumberInput
            label="UAVs"
            min={1}
            max={MAX_UAVS}
            allowDecimal={false}
            value={changes.uavs ?? card.uavs}
            onChange={(value) => change({ uavs: Number(value) })}
          />
          <Select
            label="Airframe"
            placeholder={card.airframes.join(", ")}
            data={offered?.airframes ?? card.airframes}
            value={changes.airframe ?? onlyOf(card.airframes)}
            searchable
            onChange={(airframe) => airframe !== null && change({ airframe })}
          />
          <NumberInput
            label="Seed"
            placeholder="from the scenario"
            min={0}
            max={Number.MAX_SAFE_INTEGER}
            allowDecimal={false}
            value={changes.seed ?? ""}
            onChange={(value) => value !== "" && change({ seed: Number(value) })}
          />
          {card.world === "forest" && (
            <NumberInput
              label="Trees per hectare"
              placeholder="from the scenario"
              min={0}
              max={10_000}
              value={changes.tree_density_per_ha ?? ""}
              onChange={(value) => value !== "" && change({ tree_density_per_ha: Number(value) })}
            />
          )}
        </SimpleGrid>
        {offered !== null && (
          <SensorSets
            offered={offered}
            value={changes.sensors ?? sensorSetsOf(card.sensors)}
            onChange={(sensors) => change({ sensors })}
          />
        )}
        {!card.uploaded && (
          <Text size="xs" c="dimmed">
            In a terminal: <Code>volery run {card.name} --page</Code>
          </Text>
        )}
        <SubmitRow whyNot={whyNot} justify="space-between">
          <Button variant="subtle" leftSection={<ArrowLeft size={16} />} onClick={back}>
            All scenarios
          </Button>
          <Button
            type="submit"
            loading={busy}
            disabled={whyNot !== null || card.missing !== ""}
            leftSection={<Play size={16} />}
            data-autofocus
          >
            Start
          </Button>
        </SubmitRow>
      </Stack>
    </form>
  );
}

interface SensorSetsProps {
  offered: Choices;
  value: string[];
  onChange: (sets: string[]) => void;
}

function SensorSets({ offered, value, onChange }: SensorSetsProps) {
  return (
    <Checkbox.Group
      label="Sensors of every UAV"
      description="Every UAV also has an IMU, odometry and ground truth."
      value={value}
      onChange={onChange}
    >
      <Stack gap={6} mt={6}>
        {offered.sensor_sets.map((name, i) => (
          <Checkbox
            key={name}
            value={name}
            label={name}
            description={offered.sensor_set_descriptions[i]}
          />
        ))}
      </Stack>
    </Checkbox.Group>
  );
}

/** What the server offers to choose; null: it does not report it. */
function useChoices(): Choices | null {
  const [offered, setOffered] = useState<Choices | null>(null);
  useEffect(() => {
    choices()
      .then(setOffered)
      .catch(() => undefined); // then scenarios start as they are written
  }, []);
  return offered;
}

function onlyOf(airframes: readonly string[]): string | null {
  return airframes.length === 1 ? airframes[0]! : null;
}
