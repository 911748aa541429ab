import { create } from "zustand";

export type Dock = "left" | "right" | "bottom";

/** Which panel each side of the page shows; empty: none. */
interface Layout {
  left: string;
  right: string;
  bottom: string;
}

export const useLayout = create<Layout>(() => ({ left: "vehicles", right: "", bottom: "" }));

/** Show a panel on its side, or close it where it is shown. */
export function togglePanel(dock: Dock, id: string): void {
  useLayout.setState((layout) => ({ [dock]: layout[dock] === id ? "" : id }));
}

export function openPanel(dock: Dock, id: string): void {
  useLayout.setState({ [dock]: id });
}

export function closePanel(dock: Dock): void {
  useLayout.setState({ [dock]: "" });
}
