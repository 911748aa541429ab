import { expect, test } from "vitest";
import { minSpanOf, widened } from "./plotRange.ts";

test("the quantity is known by the innermost name", () => {
  expect(minSpanOf("pose.pose.position.z")).toBe(0.5);
  expect(minSpanOf("pose.pose.orientation.w")).toBe(0.1);
  expect(minSpanOf("linear_acceleration.x")).toBe(1);
  expect(minSpanOf("angular_velocity.x")).toBe(0.2);
  expect(minSpanOf("twist.twist.angular.z")).toBe(0.2);
  expect(minSpanOf("data")).toBeNaN();
});

test("noise is not blown up to the whole plot", () => {
  expect(widened(2.999, 3.001, 0.5)).toEqual([2.75, 3.25]);
});

test("what is larger than the minimum span keeps its range", () => {
  expect(widened(0, 12, 0.5)).toEqual([0, 12]);
});

test("an unknown quantity gets a span by its size", () => {
  const [min, max] = widened(1000, 1000.001, NaN);
  expect(max - min).toBeCloseTo(10.00001);
});
