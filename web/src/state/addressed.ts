// The page's address keeps view and selection, so that a link shows what its sender sees.

import { useVehicles } from "./vehicles.ts";
import { useView, VIEWS, type ViewName } from "./view.ts";

export function followAddress(): void {
  read();
  window.addEventListener("hashchange", read);
  useView.subscribe(write);
  useVehicles.subscribe((now, before) => {
    if (now.selected !== before.selected) write();
  });
}

function read(): void {
  const kept = new URLSearchParams(location.hash.slice(1));
  const view = kept.get("view") as ViewName | null;
  if (view !== null && VIEWS.includes(view)) useView.setState({ name: view });
  const uav = kept.get("uav");
  if (uav !== null) useVehicles.setState({ selected: uav });
}

function write(): void {
  const kept = new URLSearchParams(location.hash.slice(1));
  kept.set("view", useView.getState().name);
  const { selected } = useVehicles.getState();
  if (selected === "") kept.delete("uav");
  else kept.set("uav", selected);
  history.replaceState(null, "", `#${kept}`);
}
