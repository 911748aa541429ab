// Spawns, removes and teleports UAVs and actors.

import { RefusedError, ask, order } from "./requests.ts";
import type { Position } from "./flight.ts";
import { link } from "../link.ts";

export interface Spawnable {
  uri: string;
  description: string;
}

const SPAWN_TIMEOUT_S = 60;
const RESULT_OK = 1;

export async function spawnables(): Promise<Spawnable[]> {
  const type = "simulation_interfaces/srv/GetSpawnables";
  const answer = await ask("/get_spawnables", type, {});
  return answer.spawnables.map(({ entity_resource, description }) => ({
    uri: entity_resource.uri,
    description,
  }));
}

/** New UAVs, one at each position; names of those that came. Rejects where none did. */
export async function spawn(uri: string, positions: readonly Position[]): Promise<string[]> {
  const answer = await link.call<"simulation_interfaces/srv/SpawnEntities">(
    "/spawn_entities",
    "simulation_interfaces/srv/SpawnEntities",
    {
      spawn_requests: positions.map((position) => ({
        name: "",
        allow_renaming: true,
        entity_resource: { uri },
        initial_pose: { header: { frame_id: "map" }, pose: { position, orientation: { w: 1 } } },
      })),
    },
    SPAWN_TIMEOUT_S,
  );
  const came = answer.results.filter(({ result }) => result.result === RESULT_OK);
  const refused = answer.results.find(({ result }) => result.result !== RESULT_OK);
  if (came.length === 0) {
    throw new RefusedError(refused?.result.error_message ?? answer.result.error_message);
  }
  return came.map(({ entity_name }) => entity_name);
}

export async function remove(entity: string): Promise<void> {
  await ask("/delete_entity", "simulation_interfaces/srv/DeleteEntity", { entity });
}

/** Put a UAV back to its start, repaired and charged, while the others fly on. */
export async function resetUav(name: string): Promise<void> {
  await order("/volery/reset_uav", "volery_interfaces/srv/ByName", { name });
}

/** Teleport a UAV or an actor; pose in the map. It stands still there. */
export async function putAt(
  entity: string,
  position: Position,
  orientation: { x: number; y: number; z: number; w: number },
): Promise<void> {
  await ask("/set_entity_state", "simulation_interfaces/srv/SetEntityState", {
    entity,
    state: { header: { frame_id: "map" }, pose: { position, orientation } },
    set_pose: true,
    set_twist: true,
    set_acceleration: false,
  });
}
