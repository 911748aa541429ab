// Winds are named by where they come from, clockwise from north; the map's vectors say where to.

export function fromDegrees(speed: number, degrees: number): { x: number; y: number; z: number } {
  const angle = (degrees * Math.PI) / 180;
  return { x: -speed * Math.sin(angle) || 0, y: -speed * Math.cos(angle) || 0, z: 0 };
}

export function toDegrees({ x, y }: { x: number; y: number }): number {
  return (Math.round((Math.atan2(-x, -y) * 180) / Math.PI) + 360) % 360;
}

const POINTS = [
  "north",
  "north-east",
  "east",
  "south-east",
  "south",
  "south-west",
  "west",
  "north-west",
];

/** The nearest of eight points of the compass. */
export function compass(degrees: number): string {
  return POINTS[Math.round(degrees / 45) % 8]!;
}
