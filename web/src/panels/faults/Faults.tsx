import { Autocomplete, Button, Group, NumberInput, Select, Slider, Text } from "@mantine/core";
import { Stack, TextInput, Input, ScrollArea } from "@mantine/core";
import { Zap } from "lucide-react";
import { useState } from "react";
import { injectFault } from "../../link/commands.ts";
import { attempt, showSuccess } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { simulatedS } from "../../state/simulation.ts";
import { useVehicleNames, useVehicles } from "../../state/vehicles.ts";
import { ActiveFaults } from "./ActiveFaults.tsx";
import {
  EFFECTS,
  faultOf,
  KINDS,
  OF_NO_UAV,
  USUAL,
  type FaultForm,
  type FaultKind,
} from "./fault.ts";
import { VectorInput } from "./VectorInput.tsx";

const PASSING: readonly FaultKind[] = ["motor", "sensor", "gnss_loss", "radio", "jamming"];
const SENSORS = ["imu", "odom", "range", "fix", "barometer", "magnetometer", "camera"];

/** Break something while it flies. */
export default function Faults() {
  const [form, setForm] = useState(USUAL);
  const names = useVehicleNames();
  const selected = useVehicles((vehicles) => vehicles.selected);
  const whyNot = useWhyNot();
  const change = (changed: Partial<FaultForm>) => setForm({ ...form, ...changed });
  const uav = form.uav === "" ? selected : form.uav;

  const inject = async () => {
    const fault = faultOf({ ...form, uav }, simulatedS());
    const done = await attempt("Fault injection failed", injectFault(fault));
    if (done !== null) showSuccess(`${labelOf(form.kind)} fault injected`);
  };

  return (
    <ScrollArea h="100%" type="auto">
      <Stack gap="xs" px="sm" pb="sm" maw={560}>
        <ActiveFaults />
        <Group gap="xs" grow>
          <Select
            size="xs"
            label="Fault type"
            data={KINDS}
            value={form.kind}
            allowDeselect={false}
            onChange={(kind) => change({ kind: kind as FaultKind })}
          />
          {!OF_NO_UAV.includes(form.kind) && (
            <Select
              size="xs"
              label="UAV"
              searchable
              limit={100}
              data={names}
              value={uav}
              allowDeselect={false}
              onChange={(name) => change({ uav: name ?? "" })}
            />
          )}
          {PASSING.includes(form.kind) && (
            <NumberInput
              size="xs"
              label="Duration (0: permanent)"
              suffix=" s"
              min={0}
              value={form.lastsS}
              onChange={(lastsS) => change({ lastsS: Number(lastsS) })}
            />
          )}
        </Group>
        <Details form={form} change={change} />
        <Group gap="xs">
          <Button
            size="compact-sm"
            color="red"
            variant="light"
            leftSection={<Zap size={14} />}
            disabled={whyNot !== null}
            onClick={() => void inject()}
          >
            Inject
          </Button>
          <Text size="xs" c="dimmed">
            {whyNot ??
              "The fault starts at once, is listed above while it lasts, and ends at a reset."}
          </Text>
        </Group>
      </Stack>
    </ScrollArea>
  );
}

interface DetailsProps {
  form: FaultForm;
  change: (changed: Partial<FaultForm>) => void;
}

/** What one kind of fault needs besides. */
function Details({ form, change }: DetailsProps) {
  switch (form.kind) {
    case "motor":
      return (
        <Group gap="md" grow align="start">
          <NumberInput
            size="xs"
            label="Rotor"
            description="Index from 0, as in the airframe file"
            min={0}
            allowDecimal={false}
            value={form.rotor}
            onChange={(rotor) => change({ rotor: Number(rotor) })}
          />
          <Input.Wrapper
            size="xs"
            label={`Remaining thrust: ${(100 * form.thrustFactor).toFixed(0)} %`}
          >
            <Slider
              min={0}
              max={1}
              step={0.05}
              label={null}
              thumbLabel="Remaining thrust"
              value={form.thrustFactor}
              onChange={(thrustFactor) => change({ thrustFactor })}
            />
          </Input.Wrapper>
        </Group>
      );
    case "sensor":
      return (
        <Group gap="xs" grow>
          <Autocomplete
            size="xs"
            label="Sensor"
            data={SENSORS}
            value={form.sensor}
            onChange={(sensor) => change({ sensor })}
          />
          <Select
            size="xs"
            label="Effect"
            data={EFFECTS}
            value={form.effect}
            allowDeselect={false}
            onChange={(effect) => change({ effect: effect ?? "dropped" })}
          />
          {form.effect === "biased" && (
            <TextInput
              size="xs"
              label="Bias"
              value={form.bias}
              onChange={(event) => change({ bias: event.currentTarget.value })}
            />
          )}
          {form.effect === "noisy" && (
            <TextInput
              size="xs"
              label="Standard deviation"
              value={form.sigma}
              onChange={(event) => change({ sigma: event.currentTarget.value })}
            />
          )}
        </Group>
      );
    case "jamming":
      return (
        <Group gap="xs" grow>
          <VectorInput
            label="Position, m"
            value={form.vector}
            onChange={(vector) => change({ vector })}
          />
          <NumberInput
            size="xs"
            label="Power"
            suffix=" dBm"
            min={-30}
            max={80}
            value={form.powerDbm}
            onChange={(powerDbm) => change({ powerDbm: Number(powerDbm) })}
          />
        </Group>
      );
    case "gust":
      return (
        <Group gap="xs" grow>
          <VectorInput
            label="Wind, m/s"
            value={form.vector}
            onChange={(vector) => change({ vector })}
          />
          <NumberInput
            size="xs"
            label="Rise time"
            suffix=" s"
            min={0.01}
            value={form.riseS}
            onChange={(riseS) => change({ riseS: Number(riseS) })}
          />
          <NumberInput
            size="xs"
            label="Hold time"
            suffix=" s"
            min={0}
            value={form.holdS}
            onChange={(holdS) => change({ holdS: Number(holdS) })}
          />
        </Group>
      );
    case "displacement":
      return (
        <VectorInput
          label="Offset, m"
          value={form.vector}
          onChange={(vector) => change({ vector })}
        />
      );
    case "gnss_loss":
    case "radio":
      return null;
  }
}

function labelOf(kind: FaultKind): string {
  return KINDS.find(({ value }) => value === kind)?.label ?? kind;
}
