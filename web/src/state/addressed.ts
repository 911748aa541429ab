// The page's address keeps view, camera and selection, so that a link shows what its sender sees.

import { useVehicles } from "./vehicles.ts";
import { putCamera, QUALITIES, useView, VIEWS, type CameraPose } from "./view.ts";

export function followAddress(): void {
  read();
  window.addEventListener("hashchange", read);
  useView.subscribe((now, before) => {
    const kept = ["name", "camera", "quality"] as const;
    if (kept.some((key) => now[key] !== before[key])) write();
  });
  useVehicles.subscribe((now, before) => {
    if (now.selected !== before.selected) write();
  });
}

function read(): void {
  const kept = new URLSearchParams(location.hash.slice(1));
  const view = VIEWS.find((name) => name === kept.get("view"));
  if (view !== undefined) useView.setState({ name: view });
  const quality = QUALITIES.find((name) => name === kept.get("quality"));
  if (quality !== undefined) useView.setState({ quality });
  const camera = cameraOf(kept.get("camera"));
  if (camera !== null) putCamera(camera);
  const uav = kept.get("uav");
  if (uav !== null) useVehicles.setState({ selected: uav });
}

function write(): void {
  const kept = new URLSearchParams(location.hash.slice(1));
  const { name, camera, quality } = useView.getState();
  kept.set("view", name);
  keep(kept, "camera", camera === null ? "" : cameraText(camera));
  keep(kept, "quality", quality === "auto" ? "" : quality);
  keep(kept, "uav", useVehicles.getState().selected);
  history.replaceState(history.state, "", `#${kept}`);
}

function keep(kept: URLSearchParams, key: string, value: string): void {
  if (value === "") kept.delete(key);
  else kept.set(key, value);
}

/** `x_y_z_yaw_pitch_distance`, rounded to what one can see; `_f` where it follows its UAV. */
export function cameraText({ x, y, z, yaw, pitch, distance, follows }: CameraPose): string {
  const lengths = [x, y, z].map((metres) => metres.toFixed(2));
  const rest = [yaw.toFixed(4), pitch.toFixed(4), distance.toFixed(2)];
  const text = [...lengths, ...rest].map((number) => String(Number(number))).join("_");
  return follows ? `${text}_f` : text;
}

/** The opposite; null where the text is none of ours. */
export function cameraOf(text: string | null): CameraPose | null {
  const parts = (text ?? "").split("_");
  const follows = parts.at(-1) === "f";
  if (follows) parts.pop();
  const numbers = parts.map(Number);
  if (parts.includes("") || numbers.length !== 6 || !numbers.every(Number.isFinite)) return null;
  const [x = 0, y = 0, z = 0, yaw = 0, pitch = 0, distance = 0] = numbers;
  return { x, y, z, yaw, pitch, distance, follows };
}
