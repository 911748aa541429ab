import { expect, test } from "vitest";
import { blackPlates, boardSide, isBlack, printOf } from "./tagPrint.ts";

const TAGS = ["actor", "tag", "family=36h11", "id=0", "size_m=0.8", "code=21a146bab"];

test("a print is read from the tags of an entity", () => {
  expect(printOf(TAGS)).toEqual({ code: "21a146bab", sizeM: 0.8 });
  expect(printOf(["actor", "car"])).toBeNull();
  expect(printOf(["code=21a146bab", "size_m=0"])).toBeNull();
  expect(printOf(["code=zzz", "size_m=1"])).toBeNull();
});

test("border cells are black, code cells follow the bits", () => {
  const print = printOf(TAGS)!;
  const rows = [0, 1, 2, 3, 4, 5, 6, 7].map((row) =>
    [0, 1, 2, 3, 4, 5, 6, 7].map((column) => (isBlack(print, row, column) ? "#" : ".")).join(""),
  );
  // 0x21a146bab = 001000 011010 000101 000110 101110 101011
  expect(rows).toEqual([
    "########",
    "###.####",
    "##..#.##",
    "####.#.#",
    "####..##",
    "#.#...##",
    "#.#.#..#",
    "########",
  ]);
});

test("plates cover the black cells and no more", () => {
  const print = printOf(TAGS)!;
  const cell = 0.1;
  const area = blackPlates(print).reduce((sum, { along, across }) => sum + along * across, 0);
  let black = 0;
  for (let i = 0; i < 8; i++) for (let j = 0; j < 8; j++) black += isBlack(print, i, j) ? 1 : 0;
  expect(area).toBeCloseTo(black * cell * cell);
  expect(blackPlates(print)[0]).toMatchObject({ y: 0, across: 0.8 });
  expect(blackPlates(print)[0]!.x).toBeCloseTo(0.35);
  expect(boardSide(print)).toBeCloseTo(1);
});
