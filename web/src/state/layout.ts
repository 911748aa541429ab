import { create } from "zustand";
import { keep, readKept } from "../lib/kept.ts";
import { sheetOf } from "../lib/sheet.ts";

export type Dock = "left" | "right" | "bottom";

/** What lies over the scene. */
export type Overlay = "map" | "pictures";

/** A window over the scene: its corner as shares of the room that is free, its width in pixels. */
export interface Tile {
  x: number;
  y: number;
  width: number;
}

/** Which panel each side of the page shows (empty: none), sizes, and what lies over the scene. */
interface Layout extends Record<Dock, string> {
  /** Width, of the bottom one height, in pixels. */
  sizes: Record<Dock, number>;
  /** Height of a phone's sheet, in pixels. */
  sheet: number;
  shown: Record<Overlay, boolean>;
  /** Windows by name: the map, a topic of pictures. */
  tiles: Record<string, Tile>;
  /** Topics of pictures that are shown. */
  pictures: string[];
}

const KEY = "volery.layout";
/** As in `page.css`: up to this width a panel is a sheet below the scene. */
export const NARROW_PX = 700;
export const LEAST_SIZE: Record<Dock, number> = { left: 200, right: 260, bottom: 140 };

const USUAL: Layout = {
  left: "vehicles",
  right: "",
  bottom: "",
  sizes: { left: 270, right: 330, bottom: 280 },
  sheet: 360,
  shown: { map: true, pictures: false },
  tiles: {},
  pictures: [],
};

export const useLayout = create<Layout>(() => {
  const layout = readKept(KEY, USUAL);
  // On a phone a panel takes half of the page: it begins without one.
  if (!isNarrow()) return layout;
  return { ...layout, left: "", right: "", bottom: "", shown: { map: false, pictures: false } };
});

useLayout.subscribe((layout) => keep(KEY, layout));

export function isNarrow(): boolean {
  return window.innerWidth <= NARROW_PX;
}

/** Show a panel on its side, or close it where it is shown. */
export function togglePanel(dock: Dock, id: string): void {
  if (useLayout.getState()[dock] === id) closePanel(dock);
  else openPanel(dock, id);
}

export function openPanel(dock: Dock, id: string): void {
  const others = isNarrow() ? { left: "", right: "", bottom: "" } : {};
  useLayout.setState({ ...others, [dock]: id });
}

export function closePanel(dock: Dock): void {
  useLayout.setState({ [dock]: "" });
}

export function resizeDock(dock: Dock, size: number): void {
  const room = dock === "bottom" ? window.innerHeight : window.innerWidth;
  const fitting = Math.round(Math.max(LEAST_SIZE[dock], Math.min(size, room * 0.6)));
  useLayout.setState(({ sizes }) => ({ sizes: { ...sizes, [dock]: fitting } }));
}

/** Let a phone's sheet be so high, px; one that is dragged to the foot of the page closes. */
export function resizeSheet(dock: Dock, height: number): void {
  const { sheet, closes } = sheetOf(height, window.innerHeight);
  if (closes) closePanel(dock);
  else useLayout.setState({ sheet });
}

export function toggleOverlay(overlay: Overlay): void {
  useLayout.setState(({ shown }) => ({ shown: { ...shown, [overlay]: !shown[overlay] } }));
}

export function placeTile(name: string, tile: Tile): void {
  useLayout.setState(({ tiles }) => ({ tiles: { ...tiles, [name]: tile } }));
}

export function showPicture(topic: string, shown: boolean): void {
  useLayout.setState(({ pictures }) => ({
    pictures: [...pictures.filter((other) => other !== topic), ...(shown ? [topic] : [])],
  }));
}

export function resetLayout(): void {
  useLayout.setState(USUAL);
}
