import { Ground } from "./ground.ts";
import { Obstacles } from "./obstacles.ts";

/** What the world in the picture is to somebody who stands in it. */
export const standing = {
  ground: new Ground([]),
  obstacles: new Obstacles(),
  /** Grows with each new world. */
  version: 0,
};

export function stand(ground: Ground, obstacles: Obstacles): void {
  standing.ground = ground;
  standing.obstacles = obstacles;
  standing.version++;
}
