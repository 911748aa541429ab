import type { PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { CameraMan } from "../../views/CameraMan.ts";
import type { Air } from "../air/air.ts";
import { Precipitation } from "../air/Precipitation.ts";
import { Sky } from "../air/Sky.ts";
import { Sun } from "../air/Sun.ts";
import { occupancyMaps } from "../maps/occupancyMaps.ts";
import { voxels } from "../maps/voxels.ts";
import { Markers } from "../markers/Markers.ts";
import { Frusta } from "../sensing/Frusta.ts";
import { Returns } from "../sensing/Returns.ts";
import { Actors } from "../actors/Actors.ts";
import { Airframes } from "../uavs/Airframes.ts";
import { Labels } from "../uavs/Labels.ts";
import { Lamps } from "../uavs/Lamps.ts";
import { Marks } from "../uavs/Marks.ts";
import { Paths } from "../uavs/Paths.ts";
import { Sensors } from "../uavs/Sensors.ts";
import { Smoke } from "../uavs/Smoke.ts";
import { Trails } from "../uavs/Trails.ts";
import { currentWorld } from "../world/currentWorld.ts";
import { World } from "../world/World.ts";
import { Axes } from "./Axes.ts";
import type { Part } from "./part.ts";
import { LEVELS } from "./quality.ts";

export interface Parts {
  /** In the order in which a frame brings them up to date: the camera first. */
  all: readonly (readonly [name: string, part: Part])[];
  world: World;
  sun: Sun;
}

/** Everything in the scene. A new part: a class below `scene/`, and a line here. */
export function makeParts(
  scene: Scene,
  camera: PerspectiveCamera,
  renderer: WebGLRenderer,
  air: Air,
): Parts {
  const maxParticles = LEVELS.at(-1)!.particles;
  const fixedUrl = new URLSearchParams(location.search).get("world");
  const world = new World(air, renderer, fixedUrl);
  const sun = new Sun(air, (x, y) => currentWorld.ground.heightAt(x, y));
  const all: Parts["all"] = [
    ["view", new CameraMan(camera, renderer.domElement)],
    ["world", world],
    ["uavs", new Airframes()],
    ["sensors", new Sensors()],
    ["actors", new Actors()],
    ["lamps", new Lamps(air)],
    ["smoke", new Smoke(air)],
    ["marks", new Marks()],
    ["trails", new Trails()],
    ["paths", new Paths()],
    ["returns", new Returns()],
    ["frusta", new Frusta()],
    ["voxels", voxels()],
    ["maps", occupancyMaps()],
    ["markers", new Markers()],
    ["axes", new Axes()],
    ["sky", new Sky(air)],
    ["rain", new Precipitation("rain", air, maxParticles)],
    ["snow", new Precipitation("snow", air, maxParticles)],
    ["sun", sun],
    ["labels", new Labels()],
  ];
  for (const [, { object }] of all) scene.add(object);
  return { all, world, sun };
}
