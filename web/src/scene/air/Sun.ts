import { DirectionalLight, Group, HemisphereLight, Vector3 } from "three";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import { useView } from "../../state/view.ts";
import type { Air } from "./air.ts";

/** Half a side of the square that has shadows, m, and how far ahead of the camera its middle is. */
const SPREAD_M = { near: 22, far: 90 };
const TALLEST_M = 120;
/** Shadows of what moves are renewed so often, ms. */
const MOVING_MS = 45;

/** Sun, moon and sky as lights; one map of shadows that follows the view. */
export class Sun implements Part {
  readonly object = new Group();
  private readonly sun = new DirectionalLight();
  private readonly sky = new HemisphereLight();
  private lit = -1;
  private size = -1;
  private readonly middle = new Vector3(Infinity, 0, 0);
  private readonly wanted = new Vector3();
  private renewedMs = 0;
  private spread = 0;
  private fresh = true;

  constructor(
    private readonly air: Air,
    private readonly groundAt: (x: number, y: number) => number,
  ) {
    this.object.add(this.sun, this.sun.target, this.sky);
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.03;
    this.sun.shadow.radius = 2.5;
    this.sun.shadow.autoUpdate = false;
  }

  /** What casts shadows has changed. */
  renew(): void {
    this.fresh = true;
  }

  update(moment: Moment): void {
    if (this.air.version !== this.lit) this.light();
    const shadows = useView.getState().show.shadows ? moment.quality.shadowMap : 0;
    if (shadows !== this.size) this.resize(shadows);
    if (this.size > 0) this.follow(moment);
  }

  private light(): void {
    this.lit = this.air.version;
    const { sun, above, below } = this.air.light;
    this.sun.color.setRGB(...sun);
    this.sky.color.setRGB(...above);
    this.sky.groundColor.setRGB(...below);
    this.sky.intensity = 1.35;
    this.fresh = true;
  }

  private resize(size: number): void {
    this.size = size;
    this.sun.castShadow = size > 0;
    this.sun.shadow.map?.dispose();
    this.sun.shadow.map = null;
    this.sun.shadow.mapSize.set(size, size);
    this.fresh = true;
  }

  /** Keep the map's square ahead of the camera; draw it again only when there is a reason. */
  private follow({ camera, nowMs }: Moment): void {
    const { x, y, z } = camera.position;
    const height = Math.max(2, z - this.groundAt(x, y));
    const spread = Math.min(SPREAD_M.far, Math.max(SPREAD_M.near, 1.6 * height));
    camera.getWorldDirection(this.wanted);
    this.wanted.z = Math.min(0, this.wanted.z);
    this.wanted.multiplyScalar(0.75 * spread).add(camera.position);
    this.wanted.z = this.groundAt(this.wanted.x, this.wanted.y);
    const moved = this.wanted.distanceTo(this.middle) > 0.2 * spread;
    const grown = Math.abs(spread - this.spread) > 0.25 * spread;
    const due = shown.moved && nowMs - this.renewedMs > MOVING_MS;
    if (!moved && !grown && !due && !this.fresh) return;
    if (moved || grown || this.fresh) this.aim(grown || this.spread === 0 ? spread : this.spread);
    this.renewedMs = nowMs;
    this.fresh = false;
    this.sun.shadow.needsUpdate = true;
  }

  private aim(spread: number): void {
    this.spread = spread;
    this.middle.copy(this.wanted);
    this.sun.target.position.copy(this.middle);
    this.sun.position
      .copy(this.air.towardsLight)
      .multiplyScalar(2 * TALLEST_M)
      .add(this.middle);
    const { camera } = this.sun.shadow;
    camera.left = camera.bottom = -spread;
    camera.right = camera.top = spread;
    camera.near = 1;
    camera.far = 4 * TALLEST_M;
    camera.updateProjectionMatrix();
    this.sun.target.updateMatrixWorld();
  }

  dispose(): void {
    this.sun.dispose();
    this.sky.dispose();
  }
}
