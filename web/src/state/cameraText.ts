import type { CameraPose } from "./view.ts";

/** `x_y_z_yaw_pitch_distance`, rounded to what one can see; `_f` where it follows its UAV. */
export function cameraText({ x, y, z, yaw, pitch, distance, follows }: CameraPose): string {
  const lengths = [x, y, z].map((metres) => metres.toFixed(2));
  const rest = [yaw.toFixed(4), pitch.toFixed(4), distance.toFixed(2)];
  const text = [...lengths, ...rest].map((number) => String(Number(number))).join("_");
  return follows ? `${text}_f` : text;
}

/** The opposite; null where the text is none of ours. */
export function cameraOf(text: string | null): CameraPose | null {
  const parts = (text ?? "").split("_");
  const follows = parts.at(-1) === "f";
  if (follows) parts.pop();
  const numbers = parts.map(Number);
  if (parts.includes("") || numbers.length !== 6 || !numbers.every(Number.isFinite)) return null;
  const [x = 0, y = 0, z = 0, yaw = 0, pitch = 0, distance = 0] = numbers;
  return { x, y, z, yaw, pitch, distance, follows };
}
