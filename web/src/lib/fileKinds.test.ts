import { expect, it } from "vitest";
import { ENDINGS, kindOf, UPLOAD_HINT } from "./fileKinds.ts";

it("kinds of files are recognized by their endings, tables by their first line", () => {
  expect(kindOf("town.GeoJSON", "")).toBe("city");
  expect(kindOf("hall.v2.glb", "")).toBe("mesh");
  expect(kindOf("maze.map", "type octile")).toBe("grid_map");
  expect(kindOf("plot.csv", "\n0,1,0\n1,0,0")).toBe("grid_map");
  expect(kindOf("plot.csv", "x_m,y_m,dbh_cm,species\n1,2,30,oak")).toBe("forest");
  expect(kindOf("plot.csv", "sep=;\r\n0;1;0\r\n")).toBe("grid_map");
  expect(kindOf("plot.csv", "# a map\n1.000e+00 0.000e+00\n")).toBe("grid_map");
  expect(kindOf("plot.csv", "True,False\nFalse,True\n")).toBe("grid_map");
  expect(kindOf("plot.csv", "sep=;\r\nx_m;y_m\r\n1,5;2\r\n")).toBe("forest");
  expect(kindOf("plot.csv", "# plot 7\n# x_m y_m\n1.0e+00 2.0e+00\n")).toBe("forest");
  expect(kindOf("town.geojsonl", "")).toBe("city");
  expect(kindOf("room.yaml", "image: room.pgm")).toBe("grid_map");
  expect(kindOf("room.pgm", "P5")).toBe("grid_map");
  expect(kindOf("notes.constructor", "")).toBeNull();
  expect(kindOf("flight.toml", "name = 'flight'")).toBe("scenario");
  expect(kindOf("flight.MCAP", "")).toBe("log");
  expect(kindOf("flight.bag", "")).toBe("log");
  expect(kindOf("notes.docx", "")).toBeNull();
});

it("whatever can be uploaded may be chosen, and is named", () => {
  for (const ending of [".csv", ".geojson", ".glb", ".toml", ".mcap", ".bag"])
    expect(ENDINGS.split(",")).toContain(ending);
  for (const word of ["map", "scenario", "log"]) expect(UPLOAD_HINT).toContain(word);
});
