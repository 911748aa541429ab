import { expect, test } from "vitest";
import {
  failuresOf,
  marginText,
  stateOf,
  summaryOf,
  verdictsOf,
  type Verdict,
} from "./verdicts.ts";

const passed: Verdict = {
  name: "no contact",
  kind: "no_contact",
  outcome: "passed",
  text: "1.2 m",
  margin: 1.2,
  unit: "m",
  time_s: 3.5,
  uav: "uav1",
};
const failed: Verdict = { ...passed, outcome: "failed", margin: -0.25, time_s: 7 };
const pending: Verdict = { ...passed, outcome: "pending", margin: null, time_s: null };

function message(verdicts: unknown[], over = true): string {
  return JSON.stringify({ time_s: 10, over, verdicts });
}

test("verdicts come as JSON, and anything else is none", () => {
  expect(verdictsOf(message([passed, failed]))).toEqual({ over: true, list: [passed, failed] });
  expect(verdictsOf(message([pending], false))).toEqual({ over: false, list: [pending] });
  for (const text of ["", "{", "null", "[]", '{"verdicts": 3}'])
    expect(verdictsOf(text)).toEqual({ over: false, list: [] });
});

test("what is not a verdict is left out, and wrong fields are empty", () => {
  const odd = [null, 3, {}, { ...passed, outcome: "great" }, { name: "x", outcome: "failed" }];
  const { list } = verdictsOf(message(odd));
  expect(list).toHaveLength(1);
  expect(list[0]).toMatchObject({ name: "x", text: "", margin: null, time_s: null, uav: "" });
});

test("the worst verdict is the state of all", () => {
  const of = (...list: Verdict[]) => stateOf({ over: false, list });
  expect(of(passed, passed)).toBe("passed");
  expect(of(passed, pending)).toBe("pending");
  expect(of(pending, { ...failed, outcome: "error" })).toBe("error");
  expect(of(pending, failed, passed)).toBe("failed");
  expect(summaryOf({ over: false, list: [passed, pending, failed] })).toBe("1 of 3 met");
});

test("margins have a sign, three digits and a unit", () => {
  expect(marginText(passed)).toBe("+1.20 m");
  expect(marginText(failed)).toBe("-0.250 m");
  expect(marginText({ ...passed, margin: 1234.5, unit: "" })).toBe("+1235");
  expect(marginText(pending)).toBe("");
});

test("failures are marked at their moments", () => {
  const list = [passed, failed, { ...failed, uav: "uav2" }, { ...failed, time_s: null }];
  expect(failuresOf({ over: true, list })).toEqual([7]);
});
