import { Badge, Button, CloseButton, Group, NumberInput, Paper, Text } from "@mantine/core";
import { Gamepad2, PlaneTakeoff } from "lucide-react";
import { useEffect, useRef, useState } from "react";
import { wishOfSticks, type Speeds, type Wish } from "../../lib/twist.ts";
import { sendCommand } from "../../link/commands.ts";
import { addSource, releaseControls, setHaste, setSpeeds, useFlying } from "../../state/flying.ts";
import { attempt } from "../../state/notices.ts";
import { useOtherOperator } from "../../state/operator.ts";
import { useVehicles } from "../../state/vehicles.ts";
import { connected, wishOfGamepad } from "./gamepad.ts";
import { listenToKeys } from "./keys.ts";
import { Stick } from "./Stick.tsx";

/** Manual control: pressed keys, speeds, and sticks on a touch screen. */
export function ManualControl() {
  const uav = useFlying((flying) => flying.uav);
  return uav === "" ? null : <Controls uav={uav} />;
}

function Controls({ uav }: { uav: string }) {
  const sticks = useSources();
  const wish = useFlying((flying) => flying.wish);
  const touch = window.matchMedia("(pointer: coarse)").matches;
  return (
    <>
      <Paper
        className="hands"
        data-touch={touch || undefined}
        shadow="md"
        withBorder
        p="xs"
        role="group"
        aria-label="Manual control"
      >
        <Group gap="xs" justify="space-between" wrap="nowrap">
          <Group gap={6} wrap="nowrap">
            <Gamepad2 size={18} />
            <Text fw={600} size="sm">
              Flying {uav}
            </Text>
            {connected() !== undefined && <Badge size="xs">gamepad</Badge>}
          </Group>
          <CloseButton size="sm" aria-label="Release the controls" onClick={releaseControls} />
        </Group>
        <Obstruction uav={uav} />
        {!touch && <PressedKeys wish={wish} />}
        <SpeedFields />
      </Paper>
      {touch && (
        <div className="sticks">
          <Stick label="Climb / yaw" onMove={(x, y) => (sticks.current.left = [x, y])} />
          <Stick label="Forward / lateral" onMove={(x, y) => (sticks.current.right = [x, y])} />
        </div>
      )}
    </>
  );
}

/** Keys, gamepad and on-screen sticks command velocities while this is shown. */
function useSources() {
  const sticks = useRef({ left: [0, 0] as [number, number], right: [0, 0] as [number, number] });
  useEffect(() => {
    const keys = listenToKeys();
    const forget = [
      addSource(keys.wish),
      setHaste(keys.haste),
      addSource(wishOfGamepad),
      addSource(() => wishOfSticks(sticks.current.left, sticks.current.right)),
    ];
    return () => {
      keys.close();
      for (const each of forget) each();
    };
  }, []);
  return sticks;
}

/** Why the UAV does not respond, if it does not. */
function Obstruction({ uav }: { uav: string }) {
  const vehicle = useVehicles(({ list }) => list.find(({ name }) => name === uav));
  const other = useOtherOperator(uav);
  const [busy, setBusy] = useState(false);
  if (other !== "") {
    return (
      <Text size="sm" c="red" role="alert">
        {other} controls {uav}: the server refuses your commands.
      </Text>
    );
  }
  if (vehicle?.crashed)
    return (
      <Text size="sm" c="red">
        {uav} has crashed.
      </Text>
    );
  if (vehicle?.mode !== "LANDED") return null;
  const takeOff = async () => {
    setBusy(true);
    await attempt(`${uav}: take off`, sendCommand(uav, "take_off"));
    setBusy(false);
  };
  return (
    <Group gap="xs" my={4}>
      <Text size="sm">The UAV is on the ground.</Text>
      <Button
        size="compact-sm"
        leftSection={<PlaneTakeoff size={14} />}
        loading={busy}
        onClick={() => void takeOff()}
      >
        Take off
      </Button>
    </Group>
  );
}

const CAPS: readonly { row: number; keys: readonly [string, keyof Wish, number][] }[] = [
  {
    row: 1,
    keys: [
      ["Q", "turn", 1],
      ["W", "ahead", 1],
      ["E", "turn", -1],
      ["R", "up", 1],
    ],
  },
  {
    row: 2,
    keys: [
      ["A", "left", 1],
      ["S", "ahead", -1],
      ["D", "left", -1],
      ["F", "up", -1],
    ],
  },
];

function PressedKeys({ wish }: { wish: Wish }) {
  return (
    <div className="keycaps" aria-hidden>
      {CAPS.flatMap(({ keys }) => keys).map(([cap, axis, sign]) => (
        <kbd key={cap} className="keycap" data-pressed={wish[axis] * sign > 0 || undefined}>
          {cap}
        </kbd>
      ))}
    </div>
  );
}

function SpeedFields() {
  const speeds = useFlying((flying) => flying.speeds);
  const fields: [keyof Speeds, string, string, number][] = [
    ["level", "Horizontal", "m/s", 20],
    ["climb", "Climb", "m/s", 10],
    ["turn", "Yaw", "rad/s", 4],
  ];
  return (
    <Group gap={6} wrap="nowrap" mt={6}>
      {fields.map(([key, label, unit, max]) => (
        <NumberInput
          key={key}
          size="xs"
          w={86}
          label={label}
          suffix={` ${unit}`}
          min={0.1}
          max={max}
          step={0.5}
          value={speeds[key]}
          onChange={(value) => setSpeeds({ [key]: Math.max(0.1, Math.min(max, Number(value))) })}
        />
      ))}
    </Group>
  );
}
