import type { PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { link } from "../../link/link.ts";
import { nowMs } from "../../lib/time.ts";
import { POSE } from "../../link/protocol.ts";
import { noteDrawn } from "../../state/health.ts";
import { useView } from "../../state/view.ts";
import { Air } from "../air/air.ts";
import { makeFog } from "../air/fog.ts";
import { fleet } from "../uavs/fleet.ts";
import { prepareMaterials } from "../world/materials.ts";
import { currentWorld } from "../world/currentWorld.ts";
import { debugging, noteFrame, onScreen } from "./debugging.ts";
import type { Moment } from "./part.ts";
import { Fence } from "./Fence.ts";
import { DrawingPace } from "./pace.ts";
import { makeParts, type Parts } from "./parts.ts";
import { isSoftware, levelNamed, LEVELS, QualityGovernor } from "./quality.ts";
import { shown } from "./shown.ts";

const LONGEST_STEP_S = 0.1;
const MEDIUM = 2;
const LOW = 1;

/** The scene's parts, brought up to date and drawn once a frame. */
export class Stage {
  private readonly air = new Air();
  private readonly parts: Parts;
  private readonly governor: QualityGovernor;
  private readonly moment: Moment;
  private readonly fog = makeFog();
  /** Null: a graphics card draws, as often as the browser asks. */
  private readonly pace = isSoftware() ? new DrawingPace() : null;
  private readonly fence: Fence;
  private worldVersion = 0;
  private lastMs = 0;

  constructor(
    private readonly scene: Scene,
    camera: PerspectiveCamera,
    renderer: WebGLRenderer,
    private readonly setPixelRatio: (ratio: number) => void,
  ) {
    prepareMaterials(isSoftware());
    this.governor = new QualityGovernor(isSoftware() ? LOW : MEDIUM);
    scene.fog = this.fog;
    renderer.info.autoReset = true;
    this.fence = new Fence(renderer.getContext() as WebGL2RenderingContext);
    this.parts = makeParts(scene, camera, renderer, this.air);
    const quality = LEVELS[this.governor.level]!;
    this.moment = { nowMs: 0, stepS: 0, camera, width: 1, height: 1, renderer, quality };
    this.take(quality);
    debugging.uavs = () => this.uavsOnScreen();
    debugging.groundAt = (x, y) => currentWorld.ground.heightAt(x, y);
    window.volery = debugging;
  }

  /** One frame: the whole of the page's work for it. */
  frame(width: number, height: number): void {
    const begun = performance.now();
    const { moment, pace } = this;
    if (pace?.mayBegin(begun, () => this.fence.isPassed()) === false) return;
    debugging.frameMs = begun - this.lastMs;
    this.lastMs = begun;
    moment.nowMs = nowMs();
    moment.stepS = Math.min(LONGEST_STEP_S, debugging.frameMs / 1000);
    moment.width = width;
    moment.height = height;
    this.govern();
    shown.update(link.frames, moment.nowMs);
    fleet.update();
    this.air.update(moment.stepS);
    this.fog.color.copy(this.air.haze);
    this.fog.density = this.air.light.extinction;
    this.updateParts();
    debugging.updateMs = performance.now() - begun;
    moment.renderer.render(this.scene, moment.camera);
    debugging.scriptMs = performance.now() - begun;
    if (pace !== null) {
      pace.begin(begun);
      this.fence.set();
    }
    noteDrawn();
    noteFrame(moment.renderer, moment.camera);
    if (debugging.firstRenderMs === 0 && this.parts.world.ready)
      debugging.firstRenderMs = performance.now();
  }

  dispose(): void {
    this.air.dispose();
    this.fence.dispose();
    for (const [, part] of this.parts.all) {
      this.scene.remove(part.object);
      part.dispose();
    }
  }

  private updateParts(): void {
    const { world, sun, all } = this.parts;
    if (world.version !== this.worldVersion) {
      this.worldVersion = world.version;
      sun.renew();
    }
    if (debugging.detailed) {
      for (const [name, part] of all) {
        const begun = performance.now();
        part.update(this.moment);
        debugging.parts[name] = performance.now() - begun;
      }
      return;
    }
    for (const [, part] of all) part.update(this.moment);
  }

  private govern(): void {
    const wish = useView.getState().quality;
    if (wish === "auto") this.governor.take(this.pace?.costMs ?? debugging.frameMs);
    else this.governor.level = levelNamed(wish);
    const quality = LEVELS[this.governor.level]!;
    if (quality !== this.moment.quality) this.take(quality);
  }

  private take(quality: (typeof LEVELS)[number]): void {
    this.moment.quality = quality;
    debugging.quality = quality.name;
    this.setPixelRatio(Math.min(window.devicePixelRatio, quality.pixelRatio));
  }

  private uavsOnScreen() {
    const { camera, width, height } = this.moment;
    return fleet.uavs.flatMap(({ name, row }) => {
      if (row < 0) return [];
      const at = row * POSE;
      const position = Array.from(shown.poses.subarray(at, at + 3)) as [number, number, number];
      return [onScreen(name, position, camera, width, height)];
    });
  }
}
