import { expect, test } from "vitest";
import { activeFaultsOf, faultText } from "./activeFaults.ts";

test("active faults come as JSON, and anything else is none", () => {
  const faults = [{ kind: "motor", uav: "uav1", at_s: 2, rotor: 3, thrust_factor: 0.25 }];
  expect(activeFaultsOf(JSON.stringify(faults))).toEqual(faults);
  for (const text of ["", "{", "{}", "null"]) expect(activeFaultsOf(text)).toEqual([]);
});

test("a fault says in words what is wrong", () => {
  const of = { uav: "uav1", at_s: 0 };
  expect(faultText({ ...of, kind: "motor", rotor: 3, thrust_factor: 0.25 })).toBe(
    "rotor 3 at 25 %",
  );
  expect(faultText({ ...of, kind: "sensor", sensor: "imu", effect: "stuck" })).toBe("imu stuck");
  expect(faultText({ ...of, kind: "gnss_loss" })).toBe("no GNSS");
  const jammer = { kind: "jamming", at_s: 0, position_m: [60.4, -2, 5], power_dbm: 30 };
  expect(faultText(jammer)).toBe("radio jammed with 30 dBm from (60, -2, 5) m");
});
