// What a type consists of, as rosapi describes it, and values that fit it.

/** `rosapi_msgs/msg/TypeDef`. */
export interface TypeDefinition {
  type: string;
  fieldnames: string[];
  fieldtypes: string[];
  /** -1: one value, 0: any number of them, else so many. */
  fieldarraylen: ArrayLike<number>;
  examples: string[];
  constnames: string[];
  constvalues: string[];
}

export interface Field {
  name: string;
  type: string;
  array: boolean;
  /** Fields of a nested type; null: a plain value. */
  fields: Field[] | null;
  /** Named values of an integer field's type. */
  constants: { name: string; value: string }[];
}

const DEEPEST = 12;

/** Fields of the first definition, nested ones resolved. */
export function fieldsOf(definitions: readonly TypeDefinition[]): Field[] {
  const [first] = definitions;
  return first === undefined ? [] : resolve(first, definitions, 0);
}

function resolve(
  own: TypeDefinition,
  definitions: readonly TypeDefinition[],
  depth: number,
): Field[] {
  return own.fieldnames.map((name, i) => {
    const type = own.fieldtypes[i] ?? "";
    const nested = depth < DEEPEST ? definitions.find((other) => other.type === type) : undefined;
    const fields = nested === undefined ? null : resolve(nested, definitions, depth + 1);
    return { name, type, array: own.fieldarraylen[i] !== -1, fields, constants: constantsOf(own) };
  });
}

function constantsOf({ constnames, constvalues }: TypeDefinition): Field["constants"] {
  return constnames.map((name, i) => ({ name, value: constvalues[i] ?? "" }));
}

export function isNumeric(type: string): boolean {
  return /^(u?int(8|16|32|64)|float(32|64)|byte|char|octet)$/.test(type);
}

export function isTruth(type: string): boolean {
  return type === "bool" || type === "boolean";
}

/** A value of zeros. */
export function emptyOf(fields: readonly Field[]): Record<string, unknown> {
  return Object.fromEntries(fields.map((field) => [field.name, emptyField(field)]));
}

function emptyField({ type, array, fields }: Field): unknown {
  if (array) return [];
  if (fields !== null) return emptyOf(fields);
  if (isTruth(type)) return false;
  return isNumeric(type) ? 0 : "";
}

/** Paths of all fields that can be drawn as a line; the first element stands for an array. */
export function numericPaths(fields: readonly Field[], before = ""): string[] {
  return fields.flatMap((field) => {
    const path =
      (before === "" ? field.name : `${before}.${field.name}`) + (field.array ? "[0]" : "");
    if (field.fields !== null) return numericPaths(field.fields, path);
    return isNumeric(field.type) || isTruth(field.type) ? [path] : [];
  });
}
