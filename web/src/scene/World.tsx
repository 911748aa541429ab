import { useEffect, useState } from "react";
import type { Group } from "three";
import { useSimulation } from "../state/simulation.ts";
import { loadWorld } from "./loadWorld.ts";

/** Ground, trees and buildings, as the server has them. */
export function World() {
  const id = useSimulation(({ server }) => server?.world ?? null);
  const [world, setWorld] = useState<Group | null>(null);
  useEffect(() => {
    const asked = new AbortController();
    if (id === null) setWorld(null);
    else
      loadWorld(id, asked.signal)
        .then(setWorld)
        .catch((error: unknown) => {
          if (!asked.signal.aborted) console.error("the world could not be shown:", error);
        });
    return () => asked.abort();
  }, [id]);
  return world === null ? (
    <gridHelper args={[200, 200, "#88929c", "#b6bec6"]} />
  ) : (
    <primitive object={world} />
  );
}
