import { Scene } from "../scene/Scene.tsx";
import { Banner } from "./Banner.tsx";
import { DockArea } from "./DockArea.tsx";
import { PlayerBar } from "./PlayerBar.tsx";
import { Rail } from "./Rail.tsx";
import { TopBar } from "./TopBar.tsx";

/** The whole page: the scene, and around it what steers and explains it. */
export function App() {
  return (
    <div className="page">
      <TopBar />
      <Rail />
      <DockArea dock="left" />
      <main className="scene">
        <Scene />
        <PlayerBar />
        <Banner />
      </main>
      <DockArea dock="right" />
      <DockArea dock="bottom" />
    </div>
  );
}
