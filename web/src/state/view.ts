import { create } from "zustand";

export const VIEWS = ["orbit", "walk", "fly", "chase", "onboard"] as const;
export type ViewName = (typeof VIEWS)[number];

/** From where the scene is seen, and what of it is shown. */
interface View {
  name: ViewName;
  show: Record<Layer, boolean>;
}

export const LAYERS = [
  "names",
  "trails",
  "paths",
  "lidar",
  "frusta",
  "voxels",
  "maps",
  "markers",
  "shadows",
] as const;
export type Layer = (typeof LAYERS)[number];

export const useView = create<View>(() => ({
  name: "orbit",
  show: Object.fromEntries(LAYERS.map((layer) => [layer, true])) as Record<Layer, boolean>,
}));

export function look(name: ViewName): void {
  useView.setState({ name });
}

export function showLayer(layer: Layer, shown: boolean): void {
  useView.setState(({ show }) => ({ show: { ...show, [layer]: shown } }));
}
