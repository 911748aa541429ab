// The page's address keeps view, camera and selection, so that a link shows what its sender sees.

import { cameraOf, cameraText } from "./cameraText.ts";
import { useVehicles } from "./vehicles.ts";
import { putCamera, QUALITIES, useView, VIEWS } from "./view.ts";

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
