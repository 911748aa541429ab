// Who steers which UAV, where several pilots are there.

import { order } from "./asking.ts";

/** Take a UAV; answers what this pilot is called from now on. Empty: as the server calls it. */
export async function takeControl(uav: string, pilot: string): Promise<string> {
  const type = "volery_interfaces/srv/TakeControl";
  const { message } = await order("/volery/take_control", type, { uav, pilot });
  return message.split(" steers ")[0] ?? pilot;
}

export async function releaseControl(uav: string): Promise<void> {
  await order("/volery/release_control", "volery_interfaces/srv/ReleaseControl", { uav });
}

export async function handOver(uav: string, to: string): Promise<void> {
  await order("/volery/hand_over", "volery_interfaces/srv/HandOver", { uav, to });
}
