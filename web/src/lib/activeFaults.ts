/** A fault that has begun and not ended, as in a scenario. */
export interface ActiveFault {
  kind: string;
  /** Without it, the fault is of no UAV. */
  uav?: string;
  /** Simulated times, s; without the second it stays. */
  at_s: number;
  until_s?: number;
  rotor?: number;
  thrust_factor?: number;
  sensor?: string;
  effect?: string;
  bias?: number[];
  sigma?: number[];
  position_m?: number[];
  power_dbm?: number;
}

export function activeFaultsOf(text: string): ActiveFault[] {
  try {
    const faults: unknown = JSON.parse(text);
    return Array.isArray(faults) ? (faults as ActiveFault[]) : [];
  } catch {
    return [];
  }
}

/** What is wrong, in a few words: `rotor 2 at 50 %`. */
export function faultText(fault: ActiveFault): string {
  switch (fault.kind) {
    case "motor":
      return `rotor ${fault.rotor} at ${(100 * (fault.thrust_factor ?? 0)).toFixed(0)} %`;
    case "sensor":
      return `${fault.sensor} ${fault.effect}`;
    case "gnss_loss":
      return "no GNSS";
    case "radio":
      return "no radio";
    case "jamming": {
      const at = (fault.position_m ?? []).map((metres) => metres.toFixed(0)).join(", ");
      return `radio jammed with ${fault.power_dbm} dBm from (${at}) m`;
    }
    default:
      return fault.kind;
  }
}
