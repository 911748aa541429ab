import { describe, expect, it } from "vitest";
import { emptyOf, fieldsOf, numericPaths, type TypeDefinition } from "./typeDefinitions.ts";

function definition(type: string, fields: [string, string, number][]): TypeDefinition {
  return {
    type,
    fieldnames: fields.map(([name]) => name),
    fieldtypes: fields.map(([, inner]) => inner),
    fieldarraylen: fields.map(([, , length]) => length),
    examples: fields.map(() => ""),
    constnames: [],
    constvalues: [],
  };
}

const GO_TO = [
  definition("volery_interfaces/srv/GoTo", [
    ["position", "geometry_msgs/Point", -1],
    ["frames", "string", 0],
    ["turn", "bool", -1],
    ["poses", "geometry_msgs/Point", 3],
  ]),
  definition("geometry_msgs/Point", [
    ["x", "float64", -1],
    ["y", "float64", -1],
  ]),
];

describe("a type's description", () => {
  it("makes a value of zeros", () => {
    expect(emptyOf(fieldsOf(GO_TO))).toEqual({
      position: { x: 0, y: 0 },
      frames: [],
      turn: false,
      poses: [],
    });
  });

  it("names what can be drawn", () => {
    const paths = ["position.x", "position.y", "turn", "poses[0].x", "poses[0].y"];
    expect(numericPaths(fieldsOf(GO_TO))).toEqual(paths);
  });

  it("ends where a type holds itself", () => {
    const loop = definition("a/Loop", [["inner", "a/Loop", -1]]);
    expect(numericPaths(fieldsOf([loop]))).toEqual([]);
  });
});
