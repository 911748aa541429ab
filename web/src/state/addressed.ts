// The page's address keeps scenario, view, camera and selection, so that a link shows what its sender
// sees. Another scenario than flies here is offered, not started: others may be looking on.

import { cameraOf, cameraText } from "./cameraText.ts";
import { useSimulation } from "./simulation.ts";
import { useVehicles } from "./vehicles.ts";
import { putCamera, QUALITIES, useView, VIEWS } from "./view.ts";
import { offerScenario } from "./windows.ts";

/** Scenario of the link that was followed; empty: none, or it was offered already. */
let linked = "";

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
  useSimulation.subscribe(({ server }, before) => {
    if (server?.scenario === before.server?.scenario) return;
    offerLinked();
    write();
  });
}

function offerLinked(): void {
  const scenario = useSimulation.getState().server?.scenario ?? "";
  if (scenario === "") return; // not received yet
  if (linked !== "" && linked !== scenario) offerScenario(linked);
  linked = "";
}

function read(): void {
  const kept = new URLSearchParams(location.hash.slice(1));
  const view = VIEWS.find((name) => name === kept.get("view"));
  if (view !== undefined) useView.setState({ name: view });
  const quality = QUALITIES.find((name) => name === kept.get("quality"));
  if (quality !== undefined) useView.setState({ quality });
  const camera = cameraOf(kept.get("camera"));
  if (camera !== null) putCamera(camera);
  linked = kept.get("scenario") ?? "";
  offerLinked();
  const uav = kept.get("uav");
  if (uav !== null) useVehicles.setState({ selected: uav });
}

function write(): void {
  const kept = new URLSearchParams(location.hash.slice(1));
  const { name, camera, quality } = useView.getState();
  kept.set("view", name);
  keep(kept, "scenario", useSimulation.getState().server?.scenario || linked);
  keep(kept, "camera", camera === null ? "" : cameraText(camera));
  keep(kept, "quality", quality === "auto" ? "" : quality);
  keep(kept, "uav", useVehicles.getState().selected);
  history.replaceState(history.state, "", `#${kept}`);
}

function keep(kept: URLSearchParams, key: string, value: string): void {
  if (value === "") kept.delete(key);
  else kept.set(key, value);
}
