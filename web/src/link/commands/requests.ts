// How every command is asked for: what is refused rejects with the server's reason.

import type { Services } from "../../messages/generated.ts";
import { link, type DeepPartial } from "../link.ts";

/** A simulation says no, and why. */
export class RefusedError extends Error {}

const RESULT_OK = 1;

/** Services of the simulation's own packages: `success` and `message`. */
interface Plain {
  success: boolean;
  message: string;
}

/** Services of simulation_interfaces: `result`. */
interface Standard {
  result: { result: number; error_message: string };
}

type Named = keyof Services;

/** Call one of Volery's own services, or a Trigger; its answer, or a rejection with the reason. */
export function order<N extends Named>(
  service: string,
  type: N,
  request: DeepPartial<Services[N]["request"]>,
  timeoutS?: number,
): Promise<Services[N]["response"]>;
export function order<A>(
  service: string,
  type: string,
  request: unknown,
  timeoutS?: number,
): Promise<A>;
export async function order(
  service: string,
  type: string,
  request: unknown,
  timeoutS?: number,
): Promise<unknown> {
  const answer = (await link.call(service, type, request, timeoutS)) as Plain;
  if (!answer.success) throw new RefusedError(answer.message || `${service} failed`);
  return answer;
}

/** Call a service of the standard; its answer, or a rejection with the reason. */
export async function ask<N extends Named>(
  service: string,
  type: N,
  request: DeepPartial<Services[N]["request"]>,
  timeoutS?: number,
): Promise<Services[N]["response"]> {
  const answer = await link.call(service, type, request, timeoutS);
  const { result } = answer as Standard;
  if (result.result !== RESULT_OK) {
    throw new RefusedError(result.error_message || `${service} failed`);
  }
  return answer;
}
