import { Ground } from "./ground.ts";
import { Obstacles } from "./obstacles.ts";

/** Ground and obstacles of the world in the scene. */
export const currentWorld = {
  ground: new Ground([]),
  obstacles: new Obstacles(),
  /** Grows with each new world. */
  version: 0,
};

export function setCurrentWorld(ground: Ground, obstacles: Obstacles): void {
  currentWorld.ground = ground;
  currentWorld.obstacles = obstacles;
  currentWorld.version++;
}
