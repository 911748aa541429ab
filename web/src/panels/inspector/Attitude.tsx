import { useEffect, useId, useRef } from "react";
import { horizonTransform, PITCH_SCALE, tapeMarks } from "../../lib/attitude.ts";
import { eulerOf } from "../../lib/pose.ts";
import { link } from "../../link/link.ts";
import { baseFrame } from "../../state/vehicles.ts";
import { heightAt } from "../../state/worldPlan.ts";
import classes from "./Attitude.module.css";

const RADIUS = 46;
const TAPE_X = 66;
const TAPE_WIDTH = 40;
const MARKS = 9;
const RUNGS_DEG = [-30, -20, -10, 10, 20, 30];

/** An artificial horizon and the height above ground; drawn with every frame, so without React. */
export function Attitude({ uav }: { uav: string }) {
  const drawing = useRef<SVGSVGElement>(null);
  const clip = useId();
  useEffect(() => {
    const svg = drawing.current!;
    let frame = 0;
    const draw = () => {
      frame = requestAnimationFrame(draw);
      const pose = link.frames.pose(baseFrame(uav));
      if (pose === null || !Number.isFinite(pose[2])) return;
      const { roll, pitch } = eulerOf(pose[3], pose[4], pose[5], pose[6]);
      const height = pose[2] - heightAt(pose[0], pose[1]);
      svg.querySelector("[data-horizon]")!.setAttribute("transform", horizonTransform(roll, pitch));
      drawTape(svg, height);
    };
    draw();
    return () => cancelAnimationFrame(frame);
  }, [uav]);
  return (
    <svg
      ref={drawing}
      className={classes.display}
      viewBox="-52 -50 162 100"
      role="img"
      aria-label="Attitude and height above ground"
    >
      <clipPath id={`${clip}disc`}>
        <circle r={RADIUS} />
      </clipPath>
      <clipPath id={`${clip}tape`}>
        <rect x={TAPE_X} y={-RADIUS} width={TAPE_WIDTH} height={2 * RADIUS} />
      </clipPath>
      <g clipPath={`url(#${clip}disc)`}>
        <Horizon />
      </g>
      <path className={classes.craft} d="M-26 0 h14 l4 5 M26 0 h-14 l-4 5 M0 0 v0.1" />
      <circle className={classes.rim} r={RADIUS} />
      <g clipPath={`url(#${clip}tape)`}>
        <rect
          className={classes.tape}
          x={TAPE_X}
          y={-RADIUS}
          width={TAPE_WIDTH}
          height={2 * RADIUS}
        />
        {Array.from({ length: MARKS }, (_, i) => (
          <g key={i} data-mark>
            <line className={classes.mark} x1={TAPE_X} x2={TAPE_X + 6} />
            <text className={classes.number} x={TAPE_X + 9} y={2.5} />
          </g>
        ))}
        <rect className={classes.window} x={TAPE_X + 7} y={-7} width={33} height={14} rx={2} />
        <text className={classes.value} x={TAPE_X + 10} y={3} data-height />
      </g>
    </svg>
  );
}

/** Sky, ground and a ladder of pitch, level; the frame loop turns and moves it. */
function Horizon() {
  return (
    <g data-horizon>
      <rect className={classes.sky} x={-200} y={-400} width={400} height={400} />
      <rect className={classes.earth} x={-200} y={0} width={400} height={400} />
      <line className={classes.line} x1={-200} x2={200} />
      {RUNGS_DEG.map((deg) => (
        <line
          key={deg}
          className={classes.ladder}
          x1={-Math.abs(deg) / 2 - 4}
          x2={Math.abs(deg) / 2 + 4}
          y1={-deg * PITCH_SCALE}
          y2={-deg * PITCH_SCALE}
        />
      ))}
    </g>
  );
}

function drawTape(svg: SVGSVGElement, height: number): void {
  const marks = tapeMarks(height, MARKS);
  svg.querySelectorAll("[data-mark]").forEach((element, i) => {
    element.setAttribute("transform", `translate(0 ${marks[i]!.y.toFixed(2)})`);
    element.lastElementChild!.textContent = String(marks[i]!.value);
  });
  svg.querySelector("[data-height]")!.textContent = `${height.toFixed(1)} m`;
}
