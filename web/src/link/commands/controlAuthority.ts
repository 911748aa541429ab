// Control authority: which operator controls which UAV.

import { order } from "./requests.ts";

/** Takes control of a UAV; returns the operator's name. An empty name: the server chooses one. */
export async function takeControl(uav: string, operator: string): Promise<string> {
  const type = "volery_interfaces/srv/TakeControl";
  const { message } = await order("/volery/take_control", type, { uav, operator });
  return message.split(" steers ")[0] ?? operator;
}

export async function releaseControl(uav: string): Promise<void> {
  await order("/volery/release_control", "volery_interfaces/srv/ReleaseControl", { uav });
}

export async function handOver(uav: string, to: string): Promise<void> {
  await order("/volery/hand_over", "volery_interfaces/srv/HandOver", { uav, to });
}
