// A map of map_server is two files: a .yaml, and the image that it names.

export interface Offered {
  file: File;
  /** Image of a .yaml map; null: there is none. */
  image: File | null;
}

/** What was chosen or dropped together: a .yaml and an image are one map. Null: nothing. */
export function offeredOf(files: readonly File[]): Offered | null {
  const map = files.find(({ name }) => isMap(name));
  const image = files.find(({ name }) => /\.(pgm|png)$/i.test(name)) ?? null;
  if (map !== undefined) return { file: map, image };
  return files[0] === undefined ? null : { file: files[0], image: null };
}

/** Why an offer is but half a map; null: it is whole. */
export function missingHalfOf(name: string, image: File | null): string | null {
  if (isMap(name) && image === null)
    return `${name} is a map together with its image: choose or drop both files.`;
  if (/\.pgm$/i.test(name))
    return `${name} is the image of a map: choose or drop it together with its .yaml file.`;
  return null;
}

function isMap(name: string): boolean {
  return /\.ya?ml$/i.test(name);
}
