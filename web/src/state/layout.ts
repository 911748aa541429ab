import { create } from "zustand";
import { keep, readStored } from "../lib/storage.ts";
import { sheetOf } from "../lib/sheet.ts";

export type Dock = "left" | "right" | "bottom";

/** What holds one panel: a side of the page, or the right half of its bottom. */
export type Slot = Dock | "second";

/** What lies over the scene. */
export type Overlay = "map" | "pictures";

/** A window over the scene: its corner as shares of the room that is free, its width in pixels. */
export interface Tile {
  x: number;
  y: number;
  width: number;
}

/** Which panel each slot shows (empty: none), sizes, and what lies over the scene. */
interface Layout extends Record<Slot, string> {
  /** Width, of the bottom one height, in pixels. */
  sizes: Record<Dock, number>;
  /** Width of the left half of the bottom, as a fraction. */
  split: number;
  /** Height of a phone's sheet, in pixels. */
  sheet: number;
  shown: Record<Overlay, boolean>;
  /** Windows by name: the map, a topic of images. */
  tiles: Record<string, Tile>;
  /** Image topics that are shown. */
  pictures: string[];
}

const KEY = "volery.layout";
/** As in `page.css`: up to this width a panel is a sheet below the scene. */
export const NARROW_PX = 700;
export const MIN_SIZE: Record<Dock, number> = { left: 200, right: 260, bottom: 140 };
/** Width that each half of the bottom keeps. */
const MIN_HALF_PX = 300;

const USUAL: Layout = {
  left: "vehicles",
  right: "",
  bottom: "",
  second: "",
  sizes: { left: 270, right: 330, bottom: 280 },
  split: 0.5,
  sheet: 360,
  shown: { map: true, pictures: false },
  tiles: {},
  pictures: [],
};

const NO_PANELS: Record<Slot, string> = { left: "", right: "", bottom: "", second: "" };

export const useLayout = create<Layout>(() => {
  const layout = readStored(KEY, USUAL);
  // On a phone a panel takes half of the page: it begins without one.
  if (!isNarrow()) return layout;
  return { ...layout, ...NO_PANELS, shown: { map: false, pictures: false } };
});

useLayout.subscribe((layout) => keep(KEY, layout));

export function isNarrow(): boolean {
  return window.innerWidth <= NARROW_PX;
}

/** Show a panel on its side, or close it where it is shown. */
export function togglePanel(dock: Dock, id: string): void {
  const slot = slotOf(dock, id);
  if (slot === null) openPanel(dock, id);
  else closePanel(slot);
}

/** Where a panel of a side is shown; null: nowhere. */
export function slotOf(dock: Dock, id: string, layout = useLayout.getState()): Slot | null {
  if (layout[dock] === id) return dock;
  return dock === "bottom" && layout.second === id ? "second" : null;
}

/** Show a panel; where it is shown already it stays. On a phone it is the only one. */
export function openPanel(dock: Dock, id: string): void {
  if (isNarrow()) useLayout.setState({ ...NO_PANELS, [dock]: id });
  else if (slotOf(dock, id) === null) useLayout.setState({ [dock]: id });
}

/** Show a panel of the bottom in one of its halves; one that the other half shows is swapped. */
export function putPanel(slot: "bottom" | "second", id: string): void {
  const layout = useLayout.getState();
  const other = slot === "bottom" ? "second" : "bottom";
  useLayout.setState({ [slot]: id, ...(layout[other] === id && { [other]: layout[slot] }) });
}

/** Show a bottom panel beside the one that asks for it, where there is room for two. */
export function openBeside(asking: string, id: string): void {
  if (isNarrow()) openPanel("bottom", id);
  else if (slotOf("bottom", id) === null)
    putPanel(slotOf("bottom", asking) === "second" ? "bottom" : "second", id);
}

/** Close a panel. What the right half shows takes the room of the left one. */
export function closePanel(slot: Slot): void {
  const { second } = useLayout.getState();
  if (slot === "bottom") useLayout.setState({ bottom: second, second: "" });
  else useLayout.setState({ [slot]: "" });
}

/** Move the border of the two halves of the bottom, which is `width` pixels wide. */
export function splitBottom(fraction: number, width: number): void {
  const min = Math.min(0.5, MIN_HALF_PX / width);
  useLayout.setState({ split: Math.max(min, Math.min(fraction, 1 - min)) });
}

export function resizeDock(dock: Dock, size: number): void {
  const room = dock === "bottom" ? window.innerHeight : window.innerWidth;
  const fitting = Math.round(Math.max(MIN_SIZE[dock], Math.min(size, room * 0.6)));
  useLayout.setState(({ sizes }) => ({ sizes: { ...sizes, [dock]: fitting } }));
}

/** Let a phone's sheet be so high, px; one that is dragged to the foot of the page closes. */
export function resizeSheet(slot: Slot, height: number): void {
  const { sheet, closes } = sheetOf(height, window.innerHeight);
  if (closes) closePanel(slot);
  else useLayout.setState({ sheet });
}

export function toggleOverlay(overlay: Overlay): void {
  useLayout.setState(({ shown }) => ({ shown: { ...shown, [overlay]: !shown[overlay] } }));
}

export function moveTile(name: string, tile: Tile): void {
  useLayout.setState(({ tiles }) => ({ tiles: { ...tiles, [name]: tile } }));
}

export function showCamera(topic: string, shown: boolean): void {
  useLayout.setState(({ pictures }) => ({
    pictures: [...pictures.filter((other) => other !== topic), ...(shown ? [topic] : [])],
  }));
}

export function resetLayout(): void {
  useLayout.setState(USUAL);
}
