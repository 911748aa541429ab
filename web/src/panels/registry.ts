import {
  ChartLine,
  Disc,
  List,
  Plane,
  ScrollText,
  Wrench,
  Zap,
  type LucideIcon,
} from "lucide-react";
import { lazy, type ComponentType, type LazyExoticComponent } from "react";
import type { Dock } from "../state/layout.ts";

/** A panel of the page; its script is fetched when it is first opened. */
export interface PanelEntry {
  id: string;
  title: string;
  icon: LucideIcon;
  dock: Dock;
  view: LazyExoticComponent<ComponentType>;
}

// A new panel: a file in this folder with a component as its default export, and a line here.
export const PANELS: readonly PanelEntry[] = [
  {
    id: "vehicles",
    title: "Vehicles",
    icon: Plane,
    dock: "left",
    view: lazy(() => import("./Vehicles.tsx")),
  },
  {
    id: "topics",
    title: "Topics",
    icon: List,
    dock: "bottom",
    view: lazy(() => import("./Topics/index.tsx")),
  },
  {
    id: "plots",
    title: "Plots",
    icon: ChartLine,
    dock: "bottom",
    view: lazy(() => import("./Plots/index.tsx")),
  },
  {
    id: "services",
    title: "Services",
    icon: Wrench,
    dock: "bottom",
    view: lazy(() => import("./Services/index.tsx")),
  },
  {
    id: "log",
    title: "Log",
    icon: ScrollText,
    dock: "bottom",
    view: lazy(() => import("./Log/index.tsx")),
  },
  {
    id: "faults",
    title: "Faults",
    icon: Zap,
    dock: "bottom",
    view: lazy(() => import("./Faults/index.tsx")),
  },
  {
    id: "recordings",
    title: "Recordings",
    icon: Disc,
    dock: "bottom",
    view: lazy(() => import("./Recordings/index.tsx")),
  },
];
