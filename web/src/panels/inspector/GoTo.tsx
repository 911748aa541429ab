import { ActionIcon, Button, Group, NumberInput, Tooltip } from "@mantine/core";
import { MousePointerClick, Navigation } from "lucide-react";
import { useState } from "react";
import { link } from "../../link/link.ts";
import { commandAll } from "../../state/commanding.ts";
import { goByClick, sendTo } from "../../state/goals.ts";
import { useWhyNot } from "../../state/rights.ts";
import { baseFrame } from "../../state/vehicles.ts";
import { Section } from "./Section.tsx";

const AXES = ["x", "y", "z"] as const;

/** Fly to a position in the map: by numbers or by a click. */
export function GoTo({ uav }: { uav: string }) {
  const whyNot = useWhyNot();
  const [position, setPosition] = useState(() => rounded(uav));
  return (
    <Section title="Go to">
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void commandAll("go to", [uav], () => sendTo(uav, position));
        }}
      >
        <Group gap={6} wrap="nowrap" align="end">
          {AXES.map((axis) => (
            <NumberInput
              key={axis}
              size="xs"
              label={`${axis}, m`}
              decimalScale={2}
              step={1}
              hideControls
              value={position[axis]}
              onChange={(value) => setPosition({ ...position, [axis]: Number(value) })}
            />
          ))}
          <Tooltip label={whyNot ?? "Fly to this position"}>
            <Button
              type="submit"
              size="xs"
              px={7}
              miw={30}
              disabled={whyNot !== null}
              aria-label="Go"
            >
              <Navigation size={15} />
            </Button>
          </Tooltip>
          <Tooltip label={whyNot ?? "Click a position (G)"}>
            <ActionIcon
              size={30}
              variant="default"
              aria-label="Go to a clicked position"
              disabled={whyNot !== null}
              onClick={() => void goByClick([uav])}
            >
              <MousePointerClick size={15} />
            </ActionIcon>
          </Tooltip>
        </Group>
      </form>
    </Section>
  );
}

/** Where it is now, to begin with. */
function rounded(uav: string) {
  const pose = link.frames.pose(baseFrame(uav));
  const [x, y, z] = (pose ?? [0, 0, 0]).slice(0, 3).map((value) => Math.round(value * 10) / 10);
  return { x: x!, y: y!, z: Math.max(2, z!) };
}
