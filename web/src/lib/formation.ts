interface Position {
  x: number;
  y: number;
}

/** Where each of a group goes so that its middle is at `goal` and all keep their positions in it. */
export function shifted(
  group: ReadonlyMap<string, Position>,
  goal: Position,
): Map<string, Position> {
  const positions = [...group.values()];
  const middle = (axis: "x" | "y") =>
    positions.reduce((sum, position) => sum + position[axis], 0) / positions.length;
  const [dx, dy] = [goal.x - middle("x"), goal.y - middle("y")];
  return new Map([...group].map(([name, { x, y }]) => [name, { x: x + dx, y: y + dy }]));
}
