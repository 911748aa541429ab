/** What a browser keeps for the next visit; private windows and full stores keep nothing. */
export function readStored<T extends object>(key: string, usual: T): T {
  try {
    const kept: unknown = JSON.parse(localStorage.getItem(key) ?? "null");
    return kept !== null && typeof kept === "object" ? { ...usual, ...kept } : usual;
  } catch {
    return usual;
  }
}

export function keep(key: string, value: object): void {
  try {
    localStorage.setItem(key, JSON.stringify(value));
  } catch {
    // nothing is lost but the next visit's layout
  }
}
