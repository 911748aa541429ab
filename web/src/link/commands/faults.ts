import { order } from "./requests.ts";

/** End a fault that has begun. */
export async function endFault(fault: object): Promise<void> {
  const request = { fault: JSON.stringify(fault) };
  await order("/volery/end_fault", "volery_interfaces/srv/EndFault", request);
}

/** Make something fail; `fault` as in a scenario. */
export async function injectFault(fault: Record<string, unknown>): Promise<void> {
  const request = { fault: JSON.stringify(fault) };
  await order("/volery/inject_fault", "volery_interfaces/srv/InjectFault", request);
}
