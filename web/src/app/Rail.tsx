import { ActionIcon, Stack, Tooltip } from "@mantine/core";
import { Gamepad2, Move3d } from "lucide-react";
import { useOfferedPanels } from "../panels/useOfferedPanels.ts";
import { toggleControls, useFlying } from "../state/flying.ts";
import { slotOf, togglePanel, useLayout } from "../state/layout.ts";
import { useWhyNot } from "../state/rights.ts";
import { setMoving, useTool } from "../state/tool.ts";
import { useVehicles } from "../state/vehicles.ts";

/** The column of buttons that open panels, and the tools of the hand. */
export function Rail() {
  const layout = useLayout();
  const panels = useOfferedPanels();
  return (
    <Stack component="nav" className="rail" gap={4} p={6} aria-label="Panels">
      {panels.map(({ id, title, icon: Icon, dock }) => (
        // An open panel names itself; over its first row the tooltip would only be in the way.
        <Tooltip
          key={id}
          label={title}
          position="right"
          disabled={slotOf(dock, id, layout) !== null}
        >
          <ActionIcon
            size="lg"
            variant={slotOf(dock, id, layout) !== null ? "filled" : "subtle"}
            aria-label={title}
            aria-pressed={slotOf(dock, id, layout) !== null}
            onClick={() => togglePanel(dock, id)}
          >
            <Icon size={19} />
          </ActionIcon>
        </Tooltip>
      ))}
      <div className="rail-rule" role="separator" />
      <Tools />
    </Stack>
  );
}

function Tools() {
  const uav = useVehicles(({ selected }) => selected);
  const flying = useFlying((state) => state.uav !== "");
  const moving = useTool((tool) => tool.moving);
  const whyNot = useWhyNot() ?? (uav === "" ? "No UAV is selected" : null);
  return (
    <>
      <Tooltip label={whyNot ?? `Manual control of ${uav} (C)`} position="right">
        <ActionIcon
          size="lg"
          variant={flying ? "filled" : "subtle"}
          color={flying ? "orange" : "cyan"}
          aria-label="Manual control"
          aria-pressed={flying}
          disabled={whyNot !== null}
          onClick={toggleControls}
        >
          <Gamepad2 size={19} />
        </ActionIcon>
      </Tooltip>
      <Tooltip label={whyNot ?? `Move ${uav} by dragging it (V)`} position="right">
        <ActionIcon
          size="lg"
          variant={moving ? "filled" : "subtle"}
          aria-label="Move by dragging"
          aria-pressed={moving}
          disabled={whyNot !== null}
          onClick={() => setMoving(!moving)}
        >
          <Move3d size={19} />
        </ActionIcon>
      </Tooltip>
    </>
  );
}
