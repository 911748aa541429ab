interface Place {
  x: number;
  y: number;
}

/** Where each of a group goes so that its middle is at `goal` and all keep their places in it. */
export function shifted(group: ReadonlyMap<string, Place>, goal: Place): Map<string, Place> {
  const places = [...group.values()];
  const middle = (axis: "x" | "y") =>
    places.reduce((sum, place) => sum + place[axis], 0) / places.length;
  const [dx, dy] = [goal.x - middle("x"), goal.y - middle("y")];
  return new Map([...group].map(([name, { x, y }]) => [name, { x: x + dx, y: y + dy }]));
}
