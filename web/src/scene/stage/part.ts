import type { Object3D, PerspectiveCamera, WebGLRenderer } from "three";
import type { Quality } from "./quality.ts";

/** What a part of the scene may look at while it brings itself up to date. */
export interface Moment {
  /** Wall time, ms; of the frame that is being made. */
  nowMs: number;
  /** Wall time since the last frame, s; at most a tenth. */
  stepS: number;
  camera: PerspectiveCamera;
  /** Size of the canvas, CSS pixels. */
  width: number;
  height: number;
  renderer: WebGLRenderer;
  quality: Quality;
}

/** A part of the scene. Coordinates are those of the map: ENU, metres, z up. */
export interface Part {
  readonly object: Object3D;
  /** Once a frame, in the order of `stage/parts.ts`. No allocation without need. */
  update(moment: Moment): void;
  dispose(): void;
}
