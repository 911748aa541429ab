import { uavColour } from "../../lib/uavColours.ts";
import { link } from "../../link/link.ts";
import { useColouring } from "../../state/colouring.ts";
import { baseFrame, useVehicles } from "../../state/vehicles.ts";
import { colourOf, linearOf } from "./colours.ts";

export interface ShownUav {
  name: string;
  /** Row of its pose in `shown.poses`; -1: not received yet. */
  row: number;
  airframe: string;
  mode: string;
  crashed: boolean;
  airborne: boolean;
  /** Fraction of full, mean over the rotors. */
  rotorSpeed: number;
  /** Its own one, or what `coloured` UAVs have; linear. */
  colour: [number, number, number];
}

const BASE = /^(?:(.+)\/)?base_link$/;
/** What a UAV is drawn as of which only the frame is known. */
const UNKNOWN = "";

/** The UAVs in the scene: those that the simulation publishes, else every `base_link`. */
export class ShownFleet {
  uavs: ShownUav[] = [];
  /** Grows when another UAV, row or airframe is in the list. */
  version = 0;
  /** Whether the colours stand for something else than which UAV it is. */
  coloured = false;

  private framesVersion = -1;
  private vehicles: unknown = null;
  private colouring: unknown = null;
  private byName = new Map<string, ShownUav>();

  /** Whether the list is newer than before. */
  update(): void {
    const { list } = useVehicles.getState();
    const { version } = link.frames;
    const colouring = useColouring.getState();
    if (list === this.vehicles && version === this.framesVersion && colouring === this.colouring)
      return;
    this.colouring = colouring;
    this.coloured = colouring.by !== "uav" && list.length > 0;
    this.vehicles = list;
    this.framesVersion = version;
    const next = list.length > 0 ? fromVehicles() : fromFrames();
    const alike =
      next.length === this.uavs.length &&
      next.every((uav, i) => {
        const old = this.uavs[i]!;
        return uav.name === old.name && uav.row === old.row && uav.airframe === old.airframe;
      });
    this.uavs = next;
    this.byName = new Map(next.map((uav) => [uav.name, uav]));
    if (!alike) this.version++;
  }

  named(name: string): ShownUav | undefined {
    return this.byName.get(name);
  }
}

function fromVehicles(): ShownUav[] {
  const { by, top, types } = useColouring.getState();
  return useVehicles.getState().list.map((vehicle, i) => ({
    name: vehicle.name,
    row: link.frames.row(baseFrame(vehicle.name)),
    airframe: vehicle.airframe,
    mode: vehicle.mode,
    crashed: vehicle.crashed === true,
    airborne: vehicle.airborne === true,
    rotorSpeed: Number.isFinite(vehicle.rotor_speed) ? vehicle.rotor_speed : 0,
    colour: by === "uav" ? colourOf(i) : linearOf(uavColour(vehicle, by, top, types)),
  }));
}

function fromFrames(): ShownUav[] {
  return link.frames.names.flatMap((frame, row) => {
    const found = BASE.exec(frame);
    if (found === null) return [];
    const name = found[1] ?? "robot";
    const still = { mode: "", crashed: false, airborne: false, rotorSpeed: 0 };
    return [{ name, row, airframe: UNKNOWN, ...still, colour: colourOf(row) }];
  });
}

/** Those of the page's one scene. */
export const fleet = new ShownFleet();
