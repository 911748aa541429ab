import { Menu, Paper, ActionIcon, ScrollArea, Text, Tooltip } from "@mantine/core";
import { Images } from "lucide-react";
import { useEffect } from "react";
import { showCamera, useLayout, type Tile } from "../../state/layout.ts";
import { useTopics } from "../../state/topics.ts";
import { useVehicles } from "../../state/vehicles.ts";
import { cameraTopics, colourFirst, type CameraTopic } from "./cameraTopics.ts";
import { CameraTile } from "./CameraTile.tsx";

const FIRST_TILES = 2;

/** Tiles with what cameras see, over the scene. */
export default function Cameras() {
  const cameras = cameraTopics(useTopics((topics) => topics.list));
  const chosen = useLayout((layout) => layout.pictures);
  const selected = useVehicles((vehicles) => vehicles.selected);
  const shown = cameras.filter(({ name }) => chosen.includes(name));
  const some = cameras.length > 0 && shown.length === 0;
  // Without a choice the tiles show cameras of the selected UAV.
  useEffect(() => {
    if (!some || useLayout.getState().pictures.length > 0) return;
    const own = cameras.filter(({ name }) => name.startsWith(`/${selected}/`));
    for (const { name } of colourFirst(own).slice(0, FIRST_TILES)) showCamera(name, true);
    // oxlint-disable-next-line react-hooks/exhaustive-deps -- only when there begin to be some
  }, [some, selected]);
  return (
    <>
      {shown.map((camera, i) => (
        <CameraTile key={camera.name} camera={camera} usual={usualTile(i)} />
      ))}
      <Chooser cameras={cameras} chosen={chosen} />
    </>
  );
}

/** Side by side along the bottom. */
function usualTile(i: number): Tile {
  return { x: Math.min(1, 0.02 + 0.35 * i), y: 0.97, width: 260 };
}

function Chooser({ cameras, chosen }: { cameras: CameraTopic[]; chosen: string[] }) {
  return (
    <Menu position="top-end" closeOnItemClick={false} withinPortal>
      <Menu.Target>
        <Tooltip label="Select cameras" position="left">
          <ActionIcon className="camera-chooser" size="lg" aria-label="Select cameras">
            <Images size={18} />
          </ActionIcon>
        </Tooltip>
      </Menu.Target>
      <Menu.Dropdown>
        <Menu.Label>Cameras</Menu.Label>
        {cameras.length === 0 ? (
          <Paper p="xs">
            <Text size="sm" c="dimmed">
              No cameras. Choose a scenario with cameras, or add cameras when you start one.
            </Text>
          </Paper>
        ) : (
          <ScrollArea.Autosize mah={320}>
            {cameras.map(({ name, title }) => (
              <Menu.CheckboxItem
                key={name}
                checked={chosen.includes(name)}
                onChange={(checked) => showCamera(name, checked)}
                closeMenuOnClick={false}
              >
                {title}
              </Menu.CheckboxItem>
            ))}
          </ScrollArea.Autosize>
        )}
      </Menu.Dropdown>
    </Menu>
  );
}
