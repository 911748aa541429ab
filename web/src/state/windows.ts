import { create } from "zustand";
import { offeredOf } from "../lib/mapPair.ts";

/** Large windows over the page; one at a time. */
export type WindowName = "help" | "scenarios" | "upload";

interface Windows {
  open: WindowName | null;
  /** Scenario that is to be chosen when the window of scenarios opens. */
  scenario: string;
  /** File that was dropped on the page. */
  file: File | null;
  /** Image of a .yaml map that was dropped with it. */
  image: File | null;
}

export const useWindows = create<Windows>(() => ({
  open: null,
  scenario: "",
  file: null,
  image: null,
}));

export function openWindow(open: WindowName): void {
  useWindows.setState({ open });
}

export function closeWindow(): void {
  useWindows.setState({ open: null, file: null, image: null, scenario: "" });
}

/** Offer what was chosen or dropped for an upload: one file, or the two of a map. */
export function offerFiles(files: readonly File[]): void {
  const offered = offeredOf(files);
  if (offered !== null) useWindows.setState({ open: "upload", ...offered });
}

export function offerScenario(scenario: string): void {
  useWindows.setState({ open: "scenarios", file: null, image: null, scenario });
}
