import { ActionIcon, Stack, Tooltip } from "@mantine/core";
import { PANELS } from "../panels/registry.ts";
import { togglePanel, useLayout } from "../state/layout.ts";

/** The column of buttons that open panels. */
export function Rail() {
  const layout = useLayout();
  return (
    <Stack component="nav" className="rail" gap={4} p={6} aria-label="Panels">
      {PANELS.map(({ id, title, icon: Icon, dock }) => (
        <Tooltip key={id} label={title} position="right">
          <ActionIcon
            size="lg"
            variant={layout[dock] === id ? "filled" : "subtle"}
            aria-label={title}
            aria-pressed={layout[dock] === id}
            onClick={() => togglePanel(dock, id)}
          >
            <Icon size={19} />
          </ActionIcon>
        </Tooltip>
      ))}
    </Stack>
  );
}
