import { Group, Quaternion, Vector3, type PerspectiveCamera } from "three";
import { FrameBox } from "../lib/framing.ts";
import { POSE } from "../link/protocol.ts";
import { pickUav } from "../scene/stage/picking.ts";
import type { Moment, Part } from "../scene/stage/part.ts";
import { shown } from "../scene/stage/shown.ts";
import { cameraOfUav } from "../scene/sensing/cameras.ts";
import { radiusOf } from "../scene/uavs/airframeGeometry.ts";
import { fleet } from "../scene/uavs/fleet.ts";
import { currentWorld } from "../scene/world/currentWorld.ts";
import { useTool } from "../state/tool.ts";
import { select, useVehicles } from "../state/vehicles.ts";
import { look, putCamera, useView, VIEWS, type ViewName } from "../state/view.ts";
import { Blend } from "./Blend.ts";
import { Chase } from "./Chase.ts";
import { Fly } from "./Fly.ts";
import { Hands, isTyping } from "./input.ts";
import { Onboard } from "./Onboard.ts";
import { Orbit } from "./Orbit.ts";
import { FOV, type Eye, type Rig, type Surroundings } from "./rig.ts";
import { Walk } from "./Walk.ts";

const BODY_M = 0.3;
const KNEES_M = 0.5;
const HEAD_M = 1.75;
/** The address learns of a moved camera after it has rested so long, s. */
const REST_S = 0.6;
/** UAVs as near as this to the selected one belong into its first view, m. */
const NEIGHBOURS_M = 40;
/** So long a page waits for the first UAV before it shows the world without, s. */
const LONGEST_WAIT_S = 1;

/** Moves the camera: one view at a time, changed by menu, number keys and links. */
export class CameraMan implements Part {
  readonly object = new Group();
  private readonly rigs: Record<ViewName, Rig> = {
    orbit: new Orbit(),
    walk: new Walk(),
    fly: new Fly(),
    chase: new Chase(),
    onboard: new Onboard(),
  };
  private readonly eye: Eye = { position: new Vector3(), quaternion: new Quaternion(), fov: FOV };
  private readonly blend = new Blend();
  private readonly hands: Hands;
  private readonly around: Surroundings;
  private readonly uav = {
    name: "",
    position: new Vector3(),
    quaternion: new Quaternion(),
    radius: 0.3,
  };
  private readonly box = new FrameBox();
  /** Whether the poses of all UAVs are known. */
  private complete = false;
  private readonly uavCamera: Eye = {
    position: new Vector3(),
    quaternion: new Quaternion(),
    fov: 60,
  };
  private entered: ViewName | null = null;
  private cameraVersion = 0;
  private selected = "";
  private standingVersion = 0;
  private restedS = 0;
  private waitedS = 0;
  private unsaved = false;
  private screen = { width: 1, height: 1 };
  private readonly ended = new AbortController();

  constructor(
    private readonly camera: PerspectiveCamera,
    element: HTMLElement,
  ) {
    this.around = {
      heightAt: (x, y) => currentWorld.ground.heightAt(x, y),
      walk: (from, to) => {
        const ground = currentWorld.ground.heightAt(...from);
        return currentWorld.obstacles.walk(from, to, BODY_M, ground + KNEES_M, ground + HEAD_M);
      },
      uav: null,
      uavCamera: null,
      group: { middle: [0, 0, 0], radius: 0 },
      aspect: 1,
    };
    this.hands = new Hands(element, {
      click: (x, y) => this.pick(x, y),
      doubleClick: (x, y) => {
        this.pick(x, y);
        this.focus();
      },
      hover: (x, y) => this.hover(x, y),
      leave: () => useView.setState({ hovered: "" }),
    });
    window.addEventListener("keydown", (event) => this.press(event), { signal: this.ended.signal });
  }

  update({ width, height, stepS }: Moment): void {
    this.screen = { width, height };
    this.around.aspect = width / Math.max(1, height);
    this.lookAround();
    const { name, cameraVersion, camera: kept } = useView.getState();
    if (name !== this.entered || cameraVersion !== this.cameraVersion) {
      const given = cameraVersion !== this.cameraVersion ? kept : null;
      if (this.entered === null && given === null && this.waits(stepS)) return;
      if (this.entered === null) this.prepare();
      this.enter(name, given);
      this.cameraVersion = cameraVersion;
    }
    if (this.entered === null) return; // no UAV is there to look at yet
    this.blendLeaps();
    this.rigs[name].update(this.hands, this.around, stepS, this.eye);
    this.blend.apply(this.eye, stepS);
    this.save(stepS);
    this.hands.rest();
    this.aim(width / Math.max(1, height));
  }

  dispose(): void {
    this.hands.dispose();
    this.ended.abort();
  }

  /** Whether the first view waits for the poses of the UAVs. */
  private waits(stepS: number): boolean {
    this.waitedS += stepS;
    return !this.complete && this.waitedS < LONGEST_WAIT_S;
  }

  /** Every view begins from somewhere: the first one from where orbit would. */
  private prepare(): void {
    this.rigs.orbit.enter(this.eye, this.around, null);
    this.rigs.orbit.update(this.hands, this.around, 0, this.eye);
  }

  private enter(name: ViewName, kept: Parameters<Rig["enter"]>[2]): void {
    if (this.entered !== null) this.blend.begin(this.eye);
    this.rigs[name].enter(this.eye, this.around, kept);
    this.entered = name;
    this.unsaved = true;
    this.restedS = 0;
  }

  /** Another UAV, or another world: the camera goes there and does not jump. */
  private blendLeaps(): void {
    const { selected } = useVehicles.getState();
    if (selected !== this.selected) {
      if (this.selected !== "" && this.entered !== "fly" && this.entered !== "walk")
        this.blend.begin(this.eye);
      this.selected = selected;
    }
    if (currentWorld.version !== this.standingVersion) {
      this.standingVersion = currentWorld.version;
      if (this.entered === "walk")
        this.rigs.walk.enter(this.eye, this.around, this.rigs.walk.pose());
    }
  }

  private aim(aspect: number): void {
    const { camera, eye } = this;
    camera.position.copy(eye.position);
    camera.quaternion.copy(eye.quaternion);
    if (camera.fov !== eye.fov || Math.abs(camera.aspect - aspect) > 1e-6) {
      camera.fov = eye.fov;
      camera.aspect = aspect;
      camera.updateProjectionMatrix();
    }
    camera.updateMatrixWorld();
  }

  private lookAround(): void {
    const { selected } = useVehicles.getState();
    const uav = fleet.named(selected) ?? fleet.uavs[0];
    const at = (uav?.row ?? -1) * POSE;
    const { poses } = shown;
    this.around.uav = null;
    this.around.uavCamera = null;
    this.complete = false;
    if (uav === undefined || at < 0 || !Number.isFinite(poses[at])) return;
    this.uav.name = uav.name;
    this.uav.position.fromArray(poses, at);
    this.uav.quaternion.fromArray(poses, at + 3);
    this.uav.radius = radiusOf(uav.airframe);
    this.around.uav = this.uav;
    this.gather();
    if (cameraOfUav(uav.name, this.uavCamera)) this.around.uavCamera = this.uavCamera;
  }

  /** Measures the selected UAV and those near it. */
  private gather(): void {
    const { box, around } = this;
    const { position } = this.uav;
    this.complete = true;
    box.clear();
    for (const { row } of fleet.uavs) {
      const at = row * POSE;
      const [x, y, z] = [shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]!];
      if (at < 0 || !Number.isFinite(x)) this.complete = false;
      else if (Math.hypot(x - position.x, y - position.y, z - position.z) < NEIGHBOURS_M)
        box.add(x, y, z);
    }
    box.measure(around.group);
  }

  private save(stepS: number): void {
    if (this.hands.busy) {
      this.unsaved = true;
      this.restedS = 0;
      return;
    }
    this.restedS += stepS;
    if (!this.unsaved || this.restedS < REST_S || this.entered === null) return;
    this.unsaved = false;
    useView.setState({ camera: this.rigs[this.entered].pose() });
  }

  private pick(x: number, y: number): void {
    if (useTool.getState().asking !== null) return; // the click is an answer
    const name = pickUav(x, y, this.camera, this.screen);
    if (name !== "") select(name);
  }

  private hover(x: number, y: number): void {
    const hovered = pickUav(x, y, this.camera, this.screen);
    if (hovered !== useView.getState().hovered) useView.setState({ hovered });
  }

  private focus(): void {
    if (this.entered === null) return;
    this.blend.begin(this.eye);
    if (this.rigs[this.entered].focus === undefined) look("orbit");
    else this.rigs[this.entered].focus!(this.around);
    this.unsaved = true;
  }

  private press(event: KeyboardEvent): void {
    if (isTyping(event)) return;
    const number = /^(?:Digit|Numpad)([1-5])$/.exec(event.code)?.[1];
    if (number !== undefined) look(VIEWS[Number(number) - 1]!);
    else if (event.code === "KeyF") this.focus();
    else if (event.code === "KeyR" || event.code === "Home") putCamera(null);
  }
}
