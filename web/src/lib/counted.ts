// Numbers of things in words.

/** `1 message`, `1600 messages`. */
export function counted(number: number, thing: string): string {
  return `${number} ${thing}${number === 1 ? "" : "s"}`;
}
