import { Menu, Title, UnstyledButton } from "@mantine/core";
import { ChevronDown } from "lucide-react";
import type { PanelEntry } from "../panels/registry.ts";
import { useOfferedPanels } from "../panels/useOfferedPanels.ts";
import { putPanel } from "../state/layout.ts";

/** The title of a bottom panel: a press lists the others that may take its half. */
export function PanelChoice({ slot, panel }: { slot: "bottom" | "second"; panel: PanelEntry }) {
  const panels = useOfferedPanels();
  return (
    <Menu position="top-start" width={190}>
      <Menu.Target>
        <UnstyledButton className="panel-choice" aria-label={`${panel.title}: show another panel`}>
          <Title order={6} component="h2">
            {panel.title}
          </Title>
          <ChevronDown size={14} />
        </UnstyledButton>
      </Menu.Target>
      <Menu.Dropdown>
        {panels
          .filter(({ dock, id }) => dock === "bottom" && id !== panel.id)
          .map(({ id, title, icon: Icon }) => (
            <Menu.Item key={id} leftSection={<Icon size={16} />} onClick={() => putPanel(slot, id)}>
              {title}
            </Menu.Item>
          ))}
      </Menu.Dropdown>
    </Menu>
  );
}
