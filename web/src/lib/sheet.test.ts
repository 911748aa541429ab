import { expect, test } from "vitest";
import { sheetOf } from "./sheet.ts";

test("a sheet follows the finger up to half of the screen", () => {
  expect(sheetOf(300, 844)).toEqual({ sheet: 300, closes: false });
  expect(sheetOf(800, 844)).toEqual({ sheet: 422, closes: false });
});

test("a sheet keeps a height that can be used, and closes at the foot of the screen", () => {
  expect(sheetOf(90, 844)).toEqual({ sheet: 120, closes: false });
  expect(sheetOf(40, 844).closes).toBe(true);
});
