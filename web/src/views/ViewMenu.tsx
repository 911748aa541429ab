import {
  ActionIcon,
  Checkbox,
  Group,
  Menu,
  Paper,
  SegmentedControl,
  Text,
  Tooltip,
} from "@mantine/core";
import {
  Bird,
  Camera,
  Footprints,
  Layers,
  Orbit,
  RotateCcw,
  Send,
  type LucideIcon,
} from "lucide-react";
import { COLOURINGS, type Colouring } from "../lib/uavColours.ts";
import { colourBy, useColouring } from "../state/colouring.ts";
import {
  LAYERS,
  look,
  putCamera,
  QUALITIES,
  showLayer,
  useView,
  VIEWS,
  wishQuality,
  type Layer,
  type QualityWish,
  type ViewName,
} from "../state/view.ts";

const LOOKS: Record<ViewName, { icon: LucideIcon; title: string; hint: string }> = {
  orbit: {
    icon: Orbit,
    title: "Orbit",
    hint: "Drag to turn, right button to move, wheel to zoom, F: focus",
  },
  walk: { icon: Footprints, title: "Walk", hint: "W A S D, Shift to run, drag to look around" },
  fly: { icon: Bird, title: "Fly through", hint: "W A S D, Q and E down and up, Shift: fast" },
  chase: { icon: Send, title: "Chase", hint: "Behind the selected UAV" },
  onboard: { icon: Camera, title: "On board", hint: "From the selected UAV's camera" },
};

const TITLES: Record<Layer, string> = {
  names: "Names",
  trails: "Trails",
  paths: "Paths and goals",
  lidar: "LIDAR returns",
  frusta: "Camera frusta",
  pictures: "Camera images in the scene",
  voxels: "OctoMap voxels",
  maps: "Occupancy maps",
  markers: "Markers",
  frames: "Coordinate frames",
  shadows: "Shadows",
};

const COLOURING_TITLES: Record<Colouring, string> = {
  uav: "own",
  type: "type",
  speed: "speed",
  battery: "battery",
  height: "height",
};

/** The small menu of views and layers over the scene. */
export function ViewMenu() {
  const name = useView((view) => view.name);
  return (
    <Paper
      withBorder
      shadow="sm"
      p={3}
      pos="absolute"
      top={10}
      left={10}
      role="toolbar"
      aria-label="Views"
      style={{ zIndex: 1 }}
    >
      <Group gap={2} wrap="nowrap">
        {VIEWS.map((view, i) => (
          <ViewButton key={view} view={view} number={i + 1} active={view === name} />
        ))}
        <Tooltip label="Reset view (R)">
          <ActionIcon
            variant="subtle"
            color="gray"
            aria-label="Reset view"
            onClick={() => putCamera(null)}
          >
            <RotateCcw size={16} />
          </ActionIcon>
        </Tooltip>
        <LayersMenu />
      </Group>
    </Paper>
  );
}

function ViewButton({ view, number, active }: { view: ViewName; number: number; active: boolean }) {
  const { icon: Icon, title, hint } = LOOKS[view];
  return (
    <Tooltip label={`${title} (${number}). ${hint}`} multiline maw={240}>
      <ActionIcon
        variant={active ? "filled" : "subtle"}
        {...(active ? {} : { color: "gray" })}
        aria-label={title}
        aria-pressed={active}
        onClick={() => look(view)}
      >
        <Icon size={16} />
      </ActionIcon>
    </Tooltip>
  );
}

function LayersMenu() {
  const { show, quality } = useView();
  const by = useColouring((colouring) => colouring.by);
  return (
    <Menu closeOnItemClick={false} position="bottom-start" withinPortal>
      <Menu.Target>
        <Tooltip label="Layers">
          <ActionIcon variant="subtle" color="gray" aria-label="Layers">
            <Layers size={16} />
          </ActionIcon>
        </Tooltip>
      </Menu.Target>
      <Menu.Dropdown p="sm">
        {LAYERS.map((layer) => (
          <Checkbox
            key={layer}
            size="xs"
            my={6}
            label={TITLES[layer]}
            checked={show[layer]}
            onChange={(event) => showLayer(layer, event.currentTarget.checked)}
          />
        ))}
        <Text size="xs" c="dimmed" mt="xs" mb={4}>
          Colour of UAVs
        </Text>
        <SegmentedControl
          size="xs"
          aria-label="Colour of UAVs"
          data={COLOURINGS.map((value) => ({ value, label: COLOURING_TITLES[value] }))}
          value={by}
          onChange={(value) => colourBy(value as Colouring)}
        />
        <Text size="xs" c="dimmed" mt="xs" mb={4}>
          Quality
        </Text>
        <SegmentedControl
          size="xs"
          aria-label="Quality"
          data={QUALITIES.map((value) => ({ value, label: value }))}
          value={quality}
          onChange={(value) => wishQuality(value as QualityWish)}
        />
      </Menu.Dropdown>
    </Menu>
  );
}
