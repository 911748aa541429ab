import {
  AxesHelper,
  type Color,
  GridHelper,
  Group,
  Mesh,
  type Object3D,
  type WebGLRenderer,
} from "three";
import { useSimulation } from "../../state/simulation.ts";
import { planWorld } from "../../state/worldPlan.ts";
import type { Air } from "../air/air.ts";
import type { Moment, Part } from "../stage/part.ts";
import { backdropOf } from "./beyond.ts";
import { Forest } from "./Forest.ts";
import { cornersOf, Ground } from "./ground.ts";
import { loadWorld } from "./loadWorld.ts";
import { worldMaterial, worldUniforms } from "./materials.ts";
import { obstaclesOf } from "./obstaclesOf.ts";
import type { Solid, WorldContent } from "./readWorld.ts";
import { merged } from "./shapes.ts";
import { setCurrentWorld } from "./currentWorld.ts";
import { Obstacles } from "./obstacles.ts";

/** Ground, trees and buildings, as the server has them; a grid where there is no world. */
export class World implements Part {
  readonly object = new Group();
  /** Whether what the page waits for is in the scene. */
  ready = false;
  /** Grows when something stands elsewhere: shadows are others. */
  version = 0;

  private forest: Forest | null = null;
  private readonly grid = gridOfMetres();
  private id: string | null | undefined = undefined;
  private asked = new AbortController();
  private readonly unfollow: () => void;

  constructor(
    private readonly air: Air,
    private readonly renderer: WebGLRenderer,
    private readonly fixedUrl: string | null,
  ) {
    this.object.add(this.grid);
    this.unfollow = useSimulation.subscribe(() => this.follow());
    this.follow();
  }

  update(moment: Moment): void {
    const { weather, light } = this.air;
    worldUniforms.timeS.value = (moment.nowMs / 1000) % 3600;
    worldUniforms.windMap.value.set(weather.wind[0], weather.wind[1]);
    worldUniforms.nightShare.value = light.night;
    this.forest?.update(moment);
    if (this.forest?.changed) this.version++;
  }

  dispose(): void {
    this.unfollow();
    this.asked.abort();
    this.clear();
  }

  private follow(): void {
    const { server } = useSimulation.getState();
    const id = this.fixedUrl ?? (server === null ? undefined : server.world);
    if (id === this.id) return;
    this.id = id;
    this.asked.abort();
    if (id === undefined) return;
    if (id === null) {
      this.clear();
      this.ready = true;
      return;
    }
    this.asked = new AbortController();
    const { signal } = this.asked;
    const url = this.fixedUrl ?? `./api/world.glb?world=${encodeURIComponent(id)}`;
    loadWorld(url, signal)
      .then((content) => {
        if (!signal.aborted) this.show(content);
      })
      .catch((error: unknown) => {
        if (!signal.aborted) console.error("cannot show the world:", error);
      });
  }

  private show(content: WorldContent): void {
    this.clear();
    const isGround = (name: string) => name.startsWith("ground");
    for (const mesh of merge(content.solids)) this.object.add(mesh);
    if (content.models.length > 0) {
      this.forest = new Forest(content.models, this.air, this.renderer);
      this.object.add(this.forest.object);
    }
    const ground = content.solids.filter(({ material }) => isGround(material));
    this.grid.visible = content.solids.length === 0 && content.models.length === 0;
    const surfaces = ground.map(({ geometry, transform }) =>
      geometry.clone().applyMatrix4(transform),
    );
    setCurrentWorld(new Ground(surfaces), obstaclesOf(content, isGround));
    const own = ground.findIndex(({ material }) => material === "ground");
    if (own >= 0) this.surround(cornersOf([surfaces[own]!]), ground[own]!.colour);
    planWorld(content);
    this.ready = true;
    this.version++;
  }

  private surround(corners: Float64Array, colour: Color): void {
    const backdrop = backdropOf(corners, colour);
    if (backdrop !== null) this.object.add(backdrop);
  }

  private clear(): void {
    this.forest?.dispose();
    this.forest = null;
    for (const child of this.object.children.filter((child) => child !== this.grid)) {
      this.object.remove(child);
      if (child instanceof Mesh) {
        child.geometry.dispose();
        child.material.dispose();
      }
    }
    this.grid.visible = true;
    setCurrentWorld(new Ground([]), new Obstacles());
    planWorld(null);
    this.version++;
  }
}

/** What stands once, merged by material: a city in a dozen draw calls. */
function merge(solids: readonly Solid[]): Mesh[] {
  const groups = new Map<string, Solid[]>();
  for (const solid of solids) {
    const key = `${solid.material} ${solid.map?.uuid ?? ""}`;
    groups.set(key, [...(groups.get(key) ?? []), solid]);
  }
  return [...groups.values()].map((group) => {
    const { material, map, colour } = group[0]!;
    const rounded = material.startsWith("ground");
    const white = colour.clone().setRGB(1, 1, 1);
    const mesh = new Mesh(merged(group, rounded), worldMaterial(material, white, map, true));
    mesh.castShadow = !rounded;
    mesh.receiveShadow = true;
    return mesh;
  });
}

function gridOfMetres(): Object3D {
  const grid = new GridHelper(100, 100, 0x6b7680, 0x9aa4ad);
  grid.rotation.x = Math.PI / 2;
  const axes = new AxesHelper(1);
  axes.position.z = 0.01;
  return new Group().add(grid, axes);
}
