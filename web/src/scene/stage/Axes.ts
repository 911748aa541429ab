import { Group } from "three";
import { link } from "../../link/link.ts";
import { useView } from "../../state/view.ts";
import { SegmentLines } from "../lines/SegmentLines.ts";
import { frameOf } from "./frames.ts";
import { toMap } from "./mapFrame.ts";
import type { Moment, Part } from "./part.ts";

const MAX_FRAMES = 600;
const LENGTH_M = 0.3;
const COLOURS = [
  [0.9, 0.05, 0.05],
  [0.05, 0.7, 0.1],
  [0.1, 0.25, 1],
] as const;

/** All frames as small red, green and blue axes: what a graph has of which nothing else is known. */
export class Axes implements Part {
  readonly object = new Group();
  private readonly lines = new SegmentLines(3 * MAX_FRAMES);

  constructor() {
    this.object.add(this.lines.object);
  }

  update(moment: Moment): void {
    const { frames } = useView.getState().show;
    this.object.visible = frames;
    if (!frames) return;
    let count = 0;
    for (const name of link.frames.frameNames()) {
      if (count >= 3 * MAX_FRAMES) break;
      const pose = frameOf(name);
      const from = toMap(pose, 0, 0, 0);
      COLOURS.forEach((colour, axis) => {
        const to = toMap(
          pose,
          axis === 0 ? LENGTH_M : 0,
          axis === 1 ? LENGTH_M : 0,
          axis === 2 ? LENGTH_M : 0,
        );
        if (Number.isFinite(to[0])) this.lines.put(count++, ...from, ...to, 2, colour, 1);
      });
    }
    this.lines.count = count;
    this.lines.send(0, count);
    this.lines.update(moment);
  }

  dispose(): void {
    this.lines.dispose();
  }
}
