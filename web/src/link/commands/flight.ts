// Flight commands of one UAV.

import { link } from "../link.ts";
import { order } from "./requests.ts";

export interface Position {
  x: number;
  y: number;
  z: number;
}

/** Plain services of a UAV, all of `std_srvs/srv/Trigger`. */
export const FLIGHT_COMMANDS = ["arm", "take_off", "hold", "land", "return_home", "kill"] as const;
export type FlightCommand = (typeof FLIGHT_COMMANDS)[number];

/** Returns the UAV's response message. */
export async function sendCommand(uav: string, what: FlightCommand): Promise<string> {
  const { message } = await order(`/${uav}/${what}`, "std_srvs/srv/Trigger", {});
  return message;
}

export async function takeOffTo(uav: string, altitude: number): Promise<void> {
  await order(`/${uav}/take_off_to`, "volery_interfaces/srv/TakeOffTo", { altitude });
}

/** Flies to a position in the map, m; `yaw` in rad, null: the present one. */
export async function goTo(uav: string, position: Position, yaw: number | null): Promise<void> {
  const request = { position, yaw: yaw ?? 0, keep_heading: yaw === null };
  await order(`/${uav}/go_to`, "volery_interfaces/srv/GoTo", request);
}

/** Publishes the goal of a navigation stack, for robots without that service. */
export function publishGoal(uav: string, position: Position, yaw: number): void {
  link.publish(`/${uav}/goal_pose`, "geometry_msgs/msg/PoseStamped", {
    header: { frame_id: "map" },
    pose: {
      position,
      orientation: { x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) },
    },
  });
}

export interface Twist {
  linear: Position;
  angular: Position;
}

const STILL: Twist = { linear: { x: 0, y: 0, z: 0 }, angular: { x: 0, y: 0, z: 0 } };

/** Publishes a velocity in the level heading frame, many times per second until `stopFlying`. */
export function fly(uav: string, twist: Twist): void {
  link.stream(`/${uav}/cmd_vel`, "geometry_msgs/msg/Twist", twist, STILL);
}

/** Publishes a velocity of zero once, if there was another one. */
export function stopFlying(uav: string): void {
  link.endStream(`/${uav}/cmd_vel`);
}
