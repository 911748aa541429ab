import { Group, type Mesh } from "three";
import { link } from "../../link/link.ts";
import type { Layer } from "../../state/view.ts";
import { useView } from "../../state/view.ts";
import type { Part } from "../stage/part.ts";
import { followTopics, type Follower } from "../stage/topics.ts";

interface Layered<Shown extends Mesh> {
  /** The layer that shows and hides the meshes; hidden ones are not received. */
  layer: Layer;
  types: readonly string[];
  throttleMs: number;
  /** The mesh of a message beside `others`; null where the message shows nothing. */
  build: (message: unknown, type: string, others: number) => Shown | null;
  dispose: (mesh: Shown) => void;
}

/** The newest message of each topic of some types as a mesh. */
export class TopicMeshes<Shown extends Mesh> implements Part {
  readonly object = new Group();
  private readonly meshes = new Map<string, Shown>();
  private readonly follower: Follower;

  constructor(private readonly layered: Layered<Shown>) {
    const { types, throttleMs } = layered;
    this.follower = followTopics(
      types,
      (topic, type) =>
        link.subscribe(topic, type, ({ message }) => this.replace(topic, message, type), {
          throttleMs,
        }),
      (topic) => this.remove(topic),
    );
  }

  update(): void {
    const shown = useView.getState().show[this.layered.layer];
    this.follower.enable(shown);
    this.object.visible = shown;
  }

  dispose(): void {
    this.follower.end();
    for (const topic of this.meshes.keys()) this.remove(topic);
  }

  private replace(topic: string, message: unknown, type: string): void {
    this.remove(topic);
    const mesh = this.layered.build(message, type, this.meshes.size);
    if (mesh === null) return;
    this.meshes.set(topic, mesh);
    this.object.add(mesh);
  }

  private remove(topic: string): void {
    const mesh = this.meshes.get(topic);
    if (mesh === undefined) return;
    this.object.remove(mesh);
    this.meshes.delete(topic);
    this.layered.dispose(mesh);
  }
}
