// What one UAV is told to do.

import { link } from "../link.ts";
import { order } from "./asking.ts";

export interface Place {
  x: number;
  y: number;
  z: number;
}

/** Plain services of a UAV, all of `std_srvs/srv/Trigger`. */
export const ORDERS = ["arm", "take_off", "hold", "land", "return_home", "stop"] as const;
export type Order = (typeof ORDERS)[number];

/** Answers what the UAV says to it. */
export async function tell(uav: string, what: Order): Promise<string> {
  const { message } = await order(`/${uav}/${what}`, "std_srvs/srv/Trigger", {});
  return message;
}

export async function takeOffTo(uav: string, altitude: number): Promise<void> {
  await order(`/${uav}/take_off_to`, "volery_interfaces/srv/TakeOffTo", { altitude });
}

/** Fly to a place of the map; `yaw` in rad, null: as it is. */
export async function goTo(uav: string, position: Place, yaw: number | null): Promise<void> {
  const request = { position, yaw: yaw ?? 0, keep_heading: yaw === null };
  await order(`/${uav}/go_to`, "volery_interfaces/srv/GoTo", request);
}

/** For robots without that service: the goal of the navigation stacks. */
export function publishGoal(uav: string, position: Place, yaw: number): void {
  link.publish(`/${uav}/goal_pose`, "geometry_msgs/msg/PoseStamped", {
    header: { frame_id: "map" },
    pose: {
      position,
      orientation: { x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) },
    },
  });
}

export interface Twist {
  linear: Place;
  angular: Place;
}

const STILL: Twist = { linear: { x: 0, y: 0, z: 0 }, angular: { x: 0, y: 0, z: 0 } };

/** A velocity in the level heading frame, to be told again many times a second until `stopFlying`. */
export function fly(uav: string, twist: Twist): void {
  link.stream(`/${uav}/cmd_vel`, "geometry_msgs/msg/Twist", twist, STILL);
}

/** No velocity any more; said once, if there was one. */
export function stopFlying(uav: string): void {
  link.endStream(`/${uav}/cmd_vel`);
}
