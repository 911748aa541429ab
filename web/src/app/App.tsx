import { lazy, Suspense } from "react";
import { Scene } from "../scene/Scene.tsx";
import { PlayerBar } from "./PlayerBar.tsx";
import { useLayout } from "../state/layout.ts";
import { useWindows } from "../state/windows.ts";
import { BottomArea, DockArea } from "./DockArea.tsx";
import { DropZone } from "./DropZone.tsx";
import { ManualControl } from "./manual/ManualControl.tsx";
import { Picking } from "./Picking.tsx";
import { Rail } from "./Rail.tsx";
import { SceneBoundary } from "./SceneBoundary.tsx";
import { Situation } from "./Situation.tsx";
import { ReturnsLegend } from "./ReturnsLegend.tsx";
import { UavLegend } from "./UavLegend.tsx";
import { TopBar } from "./top/TopBar.tsx";
import { useHotkeys } from "./useHotkeys.ts";

const MiniMap = lazy(() => import("../panels/map/MiniMap.tsx"));
const Cameras = lazy(() => import("../panels/cameras/Cameras.tsx"));
const Help = lazy(() => import("./Help.tsx"));
const Scenarios = lazy(() => import("../panels/scenarios/Scenarios.tsx"));
const Upload = lazy(() => import("../panels/scenarios/Upload.tsx"));

/** The whole page: the scene, and around it what steers and explains it. */
export function App() {
  useHotkeys();
  return (
    <div className="page">
      <TopBar />
      <Rail />
      <DockArea dock="left" />
      <main className="scene">
        <SceneBoundary>
          <Scene />
        </SceneBoundary>
        <PlayerBar />
        <Overlays />
        <Situation />
      </main>
      <DockArea dock="right" />
      <BottomArea />
      <Windows />
      <DropZone />
    </div>
  );
}

/** What lies over the scene. */
function Overlays() {
  const shown = useLayout((layout) => layout.shown);
  return (
    <div className="overlays">
      <div className="legends">
        <UavLegend />
        <ReturnsLegend />
      </div>
      <Suspense>
        {shown.map && <MiniMap />}
        {shown.pictures && <Cameras />}
      </Suspense>
      <Picking />
      <ManualControl />
    </div>
  );
}

function Windows() {
  const open = useWindows((windows) => windows.open);
  return (
    <Suspense>
      {open === "help" && <Help />}
      {open === "scenarios" && <Scenarios />}
      {open === "upload" && <Upload />}
    </Suspense>
  );
}
