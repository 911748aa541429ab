/** The smallest 1, 2 or 5 times a power of ten that is not below a positive value. */
export function roundAbove(value: number): number {
  const decade = 10 ** Math.floor(Math.log10(value));
  return decade * ([1, 2, 5].find((step) => step * decade >= value * (1 - 1e-9)) ?? 10);
}
