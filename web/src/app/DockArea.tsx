import { ActionIcon, Group, Loader, Title } from "@mantine/core";
import { X } from "lucide-react";
import { Suspense } from "react";
import { PANELS } from "../panels/registry.ts";
import { closePanel, useLayout, type Dock } from "../state/layout.ts";

/** One side of the page, with the panel that is open there. */
export function DockArea({ dock }: { dock: Dock }) {
  const open = useLayout((layout) => layout[dock]);
  const panel = PANELS.find(({ id }) => id === open);
  if (panel === undefined) return null;
  return (
    <aside
      className={`dock dock-${dock}`}
      aria-label={panel.title}
      style={{ display: "flex", flexDirection: "column" }}
    >
      <Group justify="space-between" px="sm" py={4} wrap="nowrap">
        <Title order={6}>{panel.title}</Title>
        <ActionIcon
          variant="subtle"
          color="gray"
          aria-label={`Close ${panel.title}`}
          onClick={() => closePanel(dock)}
        >
          <X size={16} />
        </ActionIcon>
      </Group>
      <div style={{ flex: 1, minHeight: 0 }}>
        <Suspense fallback={<Loader size="sm" m="md" />}>
          <panel.view />
        </Suspense>
      </div>
    </aside>
  );
}
