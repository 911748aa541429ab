import type { Group } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

/** Fetch the world `id`; trees come as instances. */
export async function loadWorld(id: string, signal: AbortSignal): Promise<Group> {
  const answer = await fetch(`./api/world.glb?world=${encodeURIComponent(id)}`, { signal });
  if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
  const gltf = await new GLTFLoader().parseAsync(await answer.arrayBuffer(), "./");
  return gltf.scene;
}
