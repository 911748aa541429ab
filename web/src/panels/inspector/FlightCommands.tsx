import { Button, Group, SimpleGrid, Text, Tooltip } from "@mantine/core";
import {
  CircleCheck,
  CirclePause,
  House,
  OctagonX,
  PlaneLanding,
  PlaneTakeoff,
} from "lucide-react";
import { useEffect, useState, type ReactNode } from "react";
import { sendCommand, type FlightCommand } from "../../link/commands.ts";
import { commandAll, commandText } from "../../state/commanding.ts";
import { showSuccess } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";

const KILL_ASKED_MS = 4000;

const BUTTONS: { order: FlightCommand; label: string; hint: string; icon: ReactNode }[] = [
  {
    order: "take_off",
    label: "Take off",
    hint: "Climb to the take-off altitude (T)",
    icon: <PlaneTakeoff size={16} />,
  },
  {
    order: "land",
    label: "Land",
    hint: "Land at the current position (L)",
    icon: <PlaneLanding size={16} />,
  },
  {
    order: "hold",
    label: "Hold",
    hint: "Hold the current position (H)",
    icon: <CirclePause size={16} />,
  },
  {
    order: "return_home",
    label: "Return",
    hint: "Fly home and land (B)",
    icon: <House size={16} />,
  },
  {
    order: "arm",
    label: "Arm",
    hint: "Check whether the UAV is ready",
    icon: <CircleCheck size={16} />,
  },
];

/** What needs a look at each UAV is not for several at once. */
const FOR_ONE: readonly FlightCommand[] = ["arm", "kill"];

/** Flight commands of one press each, to all of some UAVs. */
export function FlightCommands({ uavs }: { uavs: readonly string[] }) {
  const whyNot = useWhyNot();
  const [busy, setBusy] = useState<FlightCommand | null>(null);
  const alone = uavs.length === 1;
  const give = async (order: FlightCommand) => {
    setBusy(order);
    await commandAll(commandText(order), uavs, async (uav) => {
      const said = await sendCommand(uav, order);
      if (order === "arm" && said) showSuccess(said);
    });
    setBusy(null);
  };
  return (
    <SimpleGrid cols={2} spacing={6} role="group" aria-label="Commands">
      {BUTTONS.filter(({ order }) => alone || !FOR_ONE.includes(order)).map(
        ({ order, label, hint, icon }) => (
          <Tooltip key={order} label={whyNot ?? hint}>
            <Button
              variant="light"
              size="compact-md"
              h={34}
              leftSection={icon}
              disabled={whyNot !== null}
              loading={busy === order}
              onClick={() => void give(order)}
            >
              {label}
            </Button>
          </Tooltip>
        ),
      )}
      {alone && <Kill uav={uavs[0]!} disabled={whyNot !== null} give={() => void give("kill")} />}
    </SimpleGrid>
  );
}

interface KillProps {
  uav: string;
  disabled: boolean;
  give: () => void;
}

/** Stops the rotors; needs two presses, because the UAV falls. */
function Kill({ uav, disabled, give }: KillProps) {
  const [asked, setAsked] = useState(false);
  useEffect(() => {
    if (!asked) return;
    const timer = setTimeout(() => setAsked(false), KILL_ASKED_MS);
    return () => clearTimeout(timer);
  }, [asked]);
  if (!asked) {
    return (
      <Tooltip label="Stop all rotors: the UAV falls">
        <Button
          color="red"
          variant="light"
          size="compact-md"
          h={34}
          leftSection={<OctagonX size={16} />}
          disabled={disabled}
          onClick={() => setAsked(true)}
        >
          Kill
        </Button>
      </Tooltip>
    );
  }
  return (
    <Group gap={4} wrap="nowrap" role="alertdialog" aria-label={`Kill ${uav}?`}>
      <Button
        autoFocus
        color="red"
        size="compact-md"
        h={34}
        flex={1}
        px={4}
        onClick={() => {
          setAsked(false);
          give();
        }}
      >
        Stop rotors
      </Button>
      <Button
        variant="default"
        size="compact-md"
        h={34}
        px={8}
        aria-label="Cancel kill"
        onClick={() => setAsked(false)}
      >
        <Text size="sm">No</Text>
      </Button>
    </Group>
  );
}
