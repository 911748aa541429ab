import { ActionIcon, Group, Loader, Title } from "@mantine/core";
import { X } from "lucide-react";
import { Suspense } from "react";
import { PANELS } from "../panels/registry.ts";
import { closePanel, useLayout, type Dock } from "../state/layout.ts";
import { DockEdge } from "./DockEdge.tsx";
import { SheetHandle } from "./SheetHandle.tsx";

/** One side of the page, with the panel that is open there. */
export function DockArea({ dock }: { dock: Dock }) {
  const open = useLayout((layout) => layout[dock]);
  const size = useLayout((layout) => layout.sizes[dock]);
  const sheet = useLayout((layout) => layout.sheet);
  const panel = PANELS.find(({ id }) => id === open);
  if (panel === undefined) return null;
  return (
    <aside
      className={`dock dock-${dock}`}
      aria-label={panel.title}
      style={{ "--dock-size": `${size}px`, "--sheet-size": `${sheet}px` } as React.CSSProperties}
    >
      <DockEdge dock={dock} title={panel.title} />
      <SheetHandle dock={dock} title={panel.title} />
      <Group justify="space-between" px="sm" py={4} wrap="nowrap">
        <Title order={6} component="h2">
          {panel.title}
        </Title>
        <ActionIcon
          variant="subtle"
          color="gray"
          aria-label={`Close ${panel.title}`}
          onClick={() => closePanel(dock)}
        >
          <X size={16} />
        </ActionIcon>
      </Group>
      <div className="dock-content">
        <Suspense fallback={<Loader size="sm" m="md" />}>
          <panel.view />
        </Suspense>
      </div>
    </aside>
  );
}
