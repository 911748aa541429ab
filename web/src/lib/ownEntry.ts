/**
 * An entry under a name that came from elsewhere; undefined: there is none. A plain `record[name]`
 * finds what every object inherits, as under `constructor`.
 */
export function ownEntry<T>(record: Readonly<Record<string, T>>, name: string): T | undefined {
  return Object.hasOwn(record, name) ? record[name] : undefined;
}
