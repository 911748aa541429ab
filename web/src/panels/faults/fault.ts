// Faults as the simulation takes them: the same tables as in a scenario.

export const KINDS = [
  { value: "motor", label: "Rotor" },
  { value: "sensor", label: "Sensor" },
  { value: "gnss_loss", label: "GNSS loss" },
  { value: "radio", label: "Radio loss" },
  { value: "jamming", label: "Radio jamming" },
  { value: "gust", label: "Gust" },
  { value: "displacement", label: "Displacement" },
] as const;
export type FaultKind = (typeof KINDS)[number]["value"];

export const EFFECTS = [
  { value: "dropped", label: "Dropped" },
  { value: "stuck", label: "Stuck" },
  { value: "biased", label: "Biased" },
  { value: "noisy", label: "Noisy" },
];

/** Kinds that are of no UAV. */
export const OF_NO_UAV: readonly FaultKind[] = ["jamming", "gust"];

export type Vector = [number, number, number];

/** What the form holds. */
export interface FaultForm {
  kind: FaultKind;
  uav: string;
  /** How long it lasts, s; 0: it stays. */
  lastsS: number;
  rotor: number;
  /** Share of the rotor's thrust that is left. */
  thrustFactor: number;
  sensor: string;
  effect: string;
  /** Numbers with commas between them. */
  bias: string;
  sigma: string;
  /** Power of a jammer, dBm. */
  powerDbm: number;
  /** Wind of a gust, m/s, displacement or position of a jammer, m; map. */
  vector: Vector;
  riseS: number;
  holdS: number;
}

export const USUAL: FaultForm = {
  kind: "motor",
  uav: "",
  lastsS: 0,
  rotor: 0,
  thrustFactor: 0.5,
  sensor: "imu",
  effect: "dropped",
  bias: "0.1, 0, 0",
  sigma: "0.1, 0.1, 0.1",
  powerDbm: 30,
  vector: [5, 0, 0],
  riseS: 0.5,
  holdS: 1,
};

/** The fault, beginning at once. */
export function faultOf(form: FaultForm, nowS: number): Record<string, unknown> {
  const { kind, uav, lastsS } = form;
  const own = { kind, uav };
  const end = lastsS > 0 ? { until_s: nowS + lastsS } : {};
  const passing = { ...own, ...end };
  switch (kind) {
    case "motor":
      return { ...passing, rotor: form.rotor, thrust_factor: form.thrustFactor };
    case "sensor": {
      const wrong = { ...passing, sensor: form.sensor, effect: form.effect };
      if (form.effect === "biased") return { ...wrong, bias: numbersOf(form.bias) };
      return form.effect === "noisy" ? { ...wrong, sigma: numbersOf(form.sigma) } : wrong;
    }
    case "gnss_loss":
    case "radio":
      return passing;
    case "jamming":
      return { kind, ...end, position_m: form.vector, power_dbm: form.powerDbm };
    case "gust":
      return { kind, velocity_m_s: form.vector, rise_s: form.riseS, hold_s: form.holdS };
    case "displacement":
      return { ...own, offset_m: form.vector };
  }
}

function numbersOf(text: string): number[] {
  return text
    .split(/[\s,;]+/)
    .filter((part) => part !== "")
    .map(Number);
}
