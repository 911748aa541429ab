import { ActionIcon, Group, Loader, Title, Tooltip } from "@mantine/core";
import { Columns2, X } from "lucide-react";
import { Suspense, type CSSProperties, type ReactNode } from "react";
import type { PanelEntry } from "../panels/registry.ts";
import { useOfferedPanels } from "../panels/useOfferedPanels.ts";
import { closePanel, putPanel, useLayout, type Dock, type Slot } from "../state/layout.ts";
import { useNarrow } from "../state/useNarrow.ts";
import { DockEdge } from "./DockEdge.tsx";
import { PanelChoice } from "./PanelChoice.tsx";
import { SheetHandle } from "./SheetHandle.tsx";
import { SplitEdge } from "./SplitEdge.tsx";

/** One side of the page, with the panel that is open there. */
export function DockArea({ dock }: { dock: Exclude<Dock, "bottom"> }) {
  const panel = usePanel(dock);
  if (panel === undefined) return null;
  return (
    <PanelFrame slot={dock} dock={dock} panel={panel}>
      <PanelTitle panel={panel} />
    </PanelFrame>
  );
}

/** The foot of the page: one panel, or two side by side; a phone shows the left one only. */
export function BottomArea() {
  const [left, right] = [usePanel("bottom"), usePanel("second")];
  const split = useLayout((layout) => layout.split);
  const narrow = useNarrow();
  if (left === undefined) return null;
  if (right === undefined || narrow) {
    return (
      <PanelFrame
        slot="bottom"
        dock="bottom"
        panel={left}
        actions={!narrow && <SplitButton panel={left} />}
      >
        <PanelChoice slot="bottom" panel={left} />
      </PanelFrame>
    );
  }
  return (
    <div className="halves" style={{ "--split": split } as CSSProperties}>
      <PanelFrame slot="bottom" dock="bottom" panel={left}>
        <PanelChoice slot="bottom" panel={left} />
      </PanelFrame>
      <PanelFrame slot="second" dock="bottom" panel={right}>
        <SplitEdge left={left.title} right={right.title} />
        <PanelChoice slot="second" panel={right} />
      </PanelFrame>
    </div>
  );
}

interface PanelFrameProps {
  slot: Slot;
  dock: Dock;
  panel: PanelEntry;
  /** The title in its head. */
  children: ReactNode;
  /** Buttons beside the one that closes it. */
  actions?: ReactNode;
}

function PanelFrame({ slot, dock, panel, children, actions }: PanelFrameProps) {
  const size = useLayout((layout) => layout.sizes[dock]);
  const sheet = useLayout((layout) => layout.sheet);
  return (
    <aside
      className={`dock dock-${dock}`}
      aria-label={panel.title}
      style={{ "--dock-size": `${size}px`, "--sheet-size": `${sheet}px` } as CSSProperties}
    >
      <DockEdge dock={dock} title={panel.title} />
      <SheetHandle slot={slot} title={panel.title} />
      <Group px="sm" py={4} gap={4} wrap="nowrap">
        {children}
        <Group gap={0} ml="auto" wrap="nowrap">
          {actions}
          <ActionIcon
            variant="subtle"
            color="gray"
            aria-label={`Close ${panel.title}`}
            onClick={() => closePanel(slot)}
          >
            <X size={16} />
          </ActionIcon>
        </Group>
      </Group>
      <div className="dock-content">
        <Suspense fallback={<Loader size="sm" m="md" />}>
          <panel.view />
        </Suspense>
      </div>
    </aside>
  );
}

function PanelTitle({ panel }: { panel: PanelEntry }) {
  return (
    <Title order={6} component="h2">
      {panel.title}
    </Title>
  );
}

/** Opens the right half with a panel that goes well with the left one. */
function SplitButton({ panel }: { panel: PanelEntry }) {
  return (
    <Tooltip label="Show a second panel beside it">
      <ActionIcon
        variant="subtle"
        color="gray"
        aria-label={`Show a second panel beside ${panel.title}`}
        onClick={() => putPanel("second", panel.id === "plots" ? "topics" : "plots")}
      >
        <Columns2 size={16} />
      </ActionIcon>
    </Tooltip>
  );
}

function usePanel(slot: Slot): PanelEntry | undefined {
  const open = useLayout((layout) => layout[slot]);
  return useOfferedPanels().find(({ id }) => id === open);
}
