// Arrangements of the page under names: panels, sizes, tiles and plots.

import { create } from "zustand";
import { keep, readStored } from "../lib/storage.ts";
import { useLayout } from "./layout.ts";
import { usePlots } from "./plots.ts";

interface SavedLayout {
  layout: ReturnType<typeof useLayout.getState>;
  plots: ReturnType<typeof usePlots.getState>;
}

const KEY = "volery.layouts";

/** Saved layouts by name. */
export const useSavedLayouts = create<{ saved: Record<string, SavedLayout> }>(() =>
  readStored(KEY, { saved: {} }),
);
useSavedLayouts.subscribe((layouts) => keep(KEY, layouts));

/** Keep the present layout; one of the same name is replaced. */
export function saveLayout(name: string): void {
  const present = { layout: useLayout.getState(), plots: usePlots.getState() };
  useSavedLayouts.setState(({ saved }) => ({ saved: { ...saved, [name]: present } }));
}

/** Arrange the page as it was when the layout was saved. */
export function restoreLayout(name: string): void {
  const saved = useSavedLayouts.getState().saved[name];
  if (saved === undefined) return;
  useLayout.setState(saved.layout);
  usePlots.setState(saved.plots);
}

export function deleteLayout(name: string): void {
  useSavedLayouts.setState(({ saved }) => {
    const { [name]: _deleted, ...others } = saved;
    return { saved: others };
  });
}
