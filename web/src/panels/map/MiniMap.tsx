import { useComputedColorScheme } from "@mantine/core";
import { useEffect, useMemo, useRef, useState, type RefObject } from "react";
import { AutoFit, pixelOf, type MapView, type Point, type Size } from "../../lib/mapProjection.ts";
import { link } from "../../link/link.ts";
import { useColouring } from "../../state/colouring.ts";
import { useGoals } from "../../state/goals.ts";
import { baseFrame, useVehicles } from "../../state/vehicles.ts";
import { useNarrow } from "../../state/useNarrow.ts";
import { useWorldPlan, type WorldPlan } from "../../state/worldPlan.ts";
import { FloatingTile } from "../FloatingTile.tsx";
import { drawPlan, type PlanColours } from "./drawPlan.ts";
import { Pen, type Traveller } from "./drawTraffic.ts";
import { extentOf } from "./extent.ts";
import { MapButtons } from "./MapButtons.tsx";
import { MapLegend } from "./MapLegend.tsx";
import { MapCanvas } from "./MapCanvas.tsx";
import { useTrails } from "./trails.ts";
import { usePlannedPath } from "./usePlannedPath.ts";
import { uavColour } from "../../lib/uavColours.ts";
import { ownEntry } from "../../lib/ownEntry.ts";

const FRAME_MS = 66;
const BESIDE_TOOLBAR = { x: 1, y: 0, width: 300 };
/** On a phone the views' buttons take the upper edge of the scene. */
const BELOW_TOOLBAR = { ...BESIDE_TOOLBAR, y: 0.3 };

const LIGHT: PlanColours = {
  ground: [214, 222, 205],
  crown: "#7fa56b",
  trunk: "#5b4a36",
  roof: "#b3685a",
  edge: "#7a4a40",
};
const DARK: PlanColours = {
  ground: [64, 72, 66],
  crown: "#3f6b46",
  trunk: "#b39a78",
  roof: "#a35d52",
  edge: "#d99a8f",
};

/** The world from above with all UAVs; a click sends the selected one there. */
export default function MiniMap() {
  const [view, setView] = useState<MapView | null>(null);
  const [follows, setFollows] = useState(false);
  const [clickSends, setClickSends] = useState(false);
  const narrow = useNarrow();
  const canvas = useRef<HTMLCanvasElement>(null);
  const shown = useRef<MapView | null>(null);
  const auto = useRef(new AutoFit());
  const plan = useWorldPlan((world) => world.plan);
  useEffect(() => setView(null), [plan]); // another world: another view
  useDrawing(canvas, plan, view, auto.current, follows, shown);
  const fit = () => {
    auto.current.clear();
    setFollows(false);
    setView(null);
  };
  const move = (next: (view: MapView) => MapView) => {
    if (shown.current !== null) setView(next(shown.current));
  };
  return (
    <FloatingTile
      name="map"
      title="Map"
      usual={narrow ? BELOW_TOOLBAR : BESIDE_TOOLBAR}
      maxFraction={narrow ? 0.65 : 1}
      aspect={1.25}
      actions={
        <MapButtons
          fit={fit}
          follows={follows}
          setFollows={setFollows}
          clickSends={clickSends}
          setClickSends={setClickSends}
        />
      }
    >
      <MapCanvas
        canvas={canvas}
        shown={shown}
        move={move}
        stopFollowing={() => setFollows(false)}
        clickSends={clickSends}
      />
      <MapLegend />
    </FloatingTile>
  );
}

/** view: as the user left it; null: the user has not moved it. Draws a dozen times a second, whatever React does. */
function useDrawing(
  canvas: RefObject<HTMLCanvasElement | null>,
  plan: WorldPlan | null,
  view: MapView | null,
  auto: AutoFit,
  follows: boolean,
  shownNow: RefObject<MapView | null>,
): void {
  const dark = useComputedColorScheme("light") === "dark";
  const background = useMemo(() => plan && drawPlan(plan, dark ? DARK : LIGHT), [plan, dark]);
  const trails = useTrails();
  const selected = useVehicles((vehicles) => vehicles.selected);
  const path = usePlannedPath(selected);
  useEffect(() => {
    const draw = () => {
      const element = canvas.current;
      if (element === null || document.hidden || element.clientWidth === 0) return;
      const size = { width: element.clientWidth, height: element.clientHeight };
      const uavs = uavPositions();
      let shown = view ?? auto.of([plan, uavs.length], () => extentOf(plan, uavs), size);
      const pose = link.frames.pose(baseFrame(selected));
      if (follows && pose !== null) shown = { ...shown, x: pose[0], y: pose[1] };
      shownNow.current = shown;
      const context = prepared(element, size);
      if (background !== null) {
        const [left, top] = pixelOf(shown, size, background.left, background.top);
        const width = (background.right - background.left) * shown.scale;
        const height = (background.top - background.bottom) * shown.scale;
        context.drawImage(background.image, left, top, width, height);
      }
      const pen = new Pen(context, shown, size, dark);
      pen.cone();
      pen.line(trails.get(selected)?.points ?? [], "rgba(240, 62, 62, 0.75)");
      pen.line(path.current, "#f59f00", [5, 4]);
      const goal = ownEntry(useGoals.getState(), selected);
      if (goal !== undefined) pen.cross(goal.x, goal.y);
      pen.uavs(link.frames, travellers(), selected, new Set(useVehicles.getState().group));
      pen.bar();
    };
    draw();
    const timer = setInterval(draw, FRAME_MS);
    return () => clearInterval(timer);
  }, [canvas, view, auto, follows, shownNow, plan, background, selected, trails, path, dark]);
}

function prepared(element: HTMLCanvasElement, { width, height }: Size): CanvasRenderingContext2D {
  const ratio = Math.min(2, window.devicePixelRatio);
  const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (element.width !== across || element.height !== down) {
    element.width = across;
    element.height = down;
  }
  const context = element.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

/** All UAVs, in the colours that they have in the scene where these stand for something. */
function travellers(): readonly Traveller[] {
  const { list } = useVehicles.getState();
  const { by, top, types } = useColouring.getState();
  if (by === "uav") return list;
  return list.map((uav) => ({
    name: uav.name,
    crashed: uav.crashed,
    colour: `rgb(${uavColour(uav, by, top, types).join(" ")})`,
  }));
}

function uavPositions(): Point[] {
  return useVehicles.getState().list.map(({ position: p }): Point => [p.x, p.y]);
}
