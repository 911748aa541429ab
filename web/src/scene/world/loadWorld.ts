import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { readWorld, type WorldContent } from "./readWorld.ts";

/** Fetch a world and read it. */
export async function loadWorld(url: string, signal: AbortSignal): Promise<WorldContent> {
  const answer = await fetch(url, { signal });
  if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
  const gltf = await new GLTFLoader().parseAsync(await answer.arrayBuffer(), "./");
  return readWorld(gltf.scene);
}
