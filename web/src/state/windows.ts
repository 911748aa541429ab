import { create } from "zustand";

/** Large windows over the page; one at a time. */
export type WindowName = "help" | "scenarios" | "upload";

interface Windows {
  open: WindowName | null;
  /** Scenario that is to be chosen when the window of scenarios opens. */
  scenario: string;
  /** File that was dropped on the page. */
  file: File | null;
}

export const useWindows = create<Windows>(() => ({ open: null, scenario: "", file: null }));

export function openWindow(open: WindowName): void {
  useWindows.setState({ open });
}

export function closeWindow(): void {
  useWindows.setState({ open: null, file: null, scenario: "" });
}

export function offerFile(file: File): void {
  useWindows.setState({ open: "upload", file });
}

export function offerScenario(scenario: string): void {
  useWindows.setState({ open: "scenarios", file: null, scenario });
}
