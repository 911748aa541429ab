import { create } from "zustand";

export const VIEWS = ["orbit", "walk", "fly", "chase", "onboard"] as const;
export type ViewName = (typeof VIEWS)[number];

export const LAYERS = [
  "names",
  "trails",
  "paths",
  "lidar",
  "frusta",
  "pictures",
  "voxels",
  "maps",
  "markers",
  "frames",
  "shadows",
] as const;
export type Layer = (typeof LAYERS)[number];

export const QUALITIES = ["auto", "minimal", "low", "medium", "high"] as const;
export type QualityWish = (typeof QUALITIES)[number];

/** Where the camera of a free view stands (map, m) and looks (rad); of orbit: around what. */
export interface CameraPose {
  x: number;
  y: number;
  z: number;
  yaw: number;
  pitch: number;
  /** Of orbit: how far it is away from x, y, z. */
  distance: number;
  /** Of orbit: whether x, y, z go along with the selected UAV. */
  follows: boolean;
}

/** From where the scene is seen, and what of it is shown. */
interface View {
  name: ViewName;
  show: Record<Layer, boolean>;
  quality: QualityWish;
  /** The camera when it last came to rest, or where a link puts it; null: the view's own choice. */
  camera: CameraPose | null;
  /** Grows when something else than the user's hand on the view has set `camera`. */
  cameraVersion: number;
  /** UAV below the pointer; empty: none. */
  hovered: string;
}

const HIDDEN_AT_FIRST: readonly Layer[] = ["pictures", "frames"];

export const useView = create<View>(() => ({
  name: "orbit",
  show: Object.fromEntries(
    LAYERS.map((layer) => [layer, !HIDDEN_AT_FIRST.includes(layer)]),
  ) as Record<Layer, boolean>,
  quality: "auto",
  camera: null,
  cameraVersion: 0,
  hovered: "",
}));

export function look(name: ViewName): void {
  useView.setState({ name });
}

export function showLayer(layer: Layer, shown: boolean): void {
  useView.setState(({ show }) => ({ show: { ...show, [layer]: shown } }));
}

export function wishQuality(quality: QualityWish): void {
  useView.setState({ quality });
}

/** Set the camera of the present view; null: where the view begins by itself. */
export function putCamera(camera: CameraPose | null): void {
  useView.setState(({ cameraVersion }) => ({ camera, cameraVersion: cameraVersion + 1 }));
}
