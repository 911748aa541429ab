import { ActionIcon, Button, Group, Text, Tooltip } from "@mantine/core";
import { ChevronDown, Map as MapIcon, Images, Keyboard } from "lucide-react";
import { useConnection } from "../../state/connection.ts";
import { toggleOverlay, useLayout, type Overlay } from "../../state/layout.ts";
import { useSimulation } from "../../state/simulation.ts";
import { openWindow } from "../../state/windows.ts";
import { Health } from "../Health.tsx";
import { ColourScheme } from "./ColourScheme.tsx";
import { Layouts } from "./Layouts.tsx";
import { LinkBadge } from "./LinkBadge.tsx";
import { TimeControls } from "./TimeControls.tsx";

/** Name, time and health. */
export function TopBar() {
  return (
    <Group component="header" className="top" px="sm" py={6} gap="xs" justify="space-between">
      <Group gap={6} wrap="nowrap" className="top-name">
        <img src="./icon.svg" width={24} height={24} alt="" />
        <Text fw={700} visibleFrom="md">
          Volery
        </Text>
        <ScenarioButton />
      </Group>
      <TimeControls />
      <Group gap={4} wrap="nowrap">
        <Health />
        <LinkBadge />
        <OverlayButton overlay="map" label="Map (M)" icon={<MapIcon size={18} />} />
        <OverlayButton overlay="pictures" label="Cameras (P)" icon={<Images size={18} />} />
        <Layouts />
        <ColourScheme />
        <Tooltip label="Keyboard shortcuts (?)">
          <ActionIcon
            variant="subtle"
            size="lg"
            visibleFrom="xs"
            aria-label="Keyboard shortcuts"
            onClick={() => openWindow("help")}
          >
            <Keyboard size={18} />
          </ActionIcon>
        </Tooltip>
      </Group>
    </Group>
  );
}

function ScenarioButton() {
  const named = useSimulation(({ server, status }) => server?.scenario || status?.scenario || "");
  const volery = useConnection((connection) => connection.volery);
  const title = useSimulation(({ server }) => server?.title) || named;
  if (!volery) return <Text truncate>{named || "Robot"}</Text>;
  return (
    <Button
      variant="subtle"
      size="compact-md"
      className="top-scenario"
      rightSection={<ChevronDown size={16} />}
      onClick={() => openWindow("scenarios")}
      aria-label={`${title}. Scenario ${named}: choose another scenario`}
    >
      <Text truncate inherit>
        {title || "Choose a scenario"}
      </Text>
    </Button>
  );
}

interface OverlayButtonProps {
  overlay: Overlay;
  label: string;
  icon: React.ReactNode;
}

function OverlayButton({ overlay, label, icon }: OverlayButtonProps) {
  const shown = useLayout((layout) => layout.shown[overlay]);
  return (
    <Tooltip label={label}>
      <ActionIcon
        variant={shown ? "light" : "subtle"}
        size="lg"
        aria-label={label}
        aria-pressed={shown}
        onClick={() => toggleOverlay(overlay)}
      >
        {icon}
      </ActionIcon>
    </Tooltip>
  );
}
