import {
  Brain,
  ChartLine,
  ChartSpline,
  CloudSun,
  Disc,
  List,
  Plane,
  ScrollText,
  SlidersHorizontal,
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
    view: lazy(() => import("./vehicles/Vehicles.tsx")),
  },
  {
    id: "inspector",
    title: "Inspector",
    icon: SlidersHorizontal,
    dock: "right",
    view: lazy(() => import("./inspector/Inspector.tsx")),
  },
  {
    id: "environment",
    title: "Environment",
    icon: CloudSun,
    dock: "right",
    view: lazy(() => import("./environment/Environment.tsx")),
  },
  {
    id: "topics",
    title: "Topics",
    icon: List,
    dock: "bottom",
    view: lazy(() => import("./topics/Topics.tsx")),
  },
  {
    id: "plots",
    title: "Plots",
    icon: ChartLine,
    dock: "bottom",
    view: lazy(() => import("./plots/Plots.tsx")),
  },
  {
    id: "services",
    title: "Services",
    icon: Wrench,
    dock: "bottom",
    view: lazy(() => import("./services/Services.tsx")),
  },
  {
    id: "log",
    title: "Log",
    icon: ScrollText,
    dock: "bottom",
    view: lazy(() => import("./log/Log.tsx")),
  },
  {
    id: "policy",
    title: "Policy",
    icon: Brain,
    dock: "bottom",
    view: lazy(() => import("./policy/Policy.tsx")),
  },
  {
    id: "tensorboard",
    title: "TensorBoard",
    icon: ChartSpline,
    dock: "bottom",
    view: lazy(() => import("./tensorboard/TensorBoard.tsx")),
  },
  {
    id: "faults",
    title: "Faults",
    icon: Zap,
    dock: "bottom",
    view: lazy(() => import("./faults/Faults.tsx")),
  },
  {
    id: "recordings",
    title: "Recordings",
    icon: Disc,
    dock: "bottom",
    view: lazy(() => import("./recordings/Recordings.tsx")),
  },
];
