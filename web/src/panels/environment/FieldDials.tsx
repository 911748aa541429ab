import { Dial } from "./Dial.tsx";

/** A slider of one number of a message. */
export interface DialField<Key extends string> {
  key: Key;
  name: string;
  min: number;
  max: number;
  step: number;
  /** The slider's position as text. */
  text: (position: number) => string;
  /** Where the slider's positions are not the values themselves. */
  scale?: { positionOf: (value: number) => number; valueOf: (position: number) => number };
}

interface FieldDialsProps<Key extends string> {
  fields: readonly DialField<Key>[];
  values: Readonly<Record<Key, number>>;
  disabled: boolean;
  change: (changes: Partial<Record<Key, number>>) => void;
}

/** Sliders of some fields of a message; moving one changes that field alone. */
export function FieldDials<Key extends string>(props: FieldDialsProps<Key>) {
  const { fields, values, disabled, change } = props;
  return fields.map(({ key, scale, ...dial }) => (
    <Dial
      key={key}
      {...dial}
      value={scale?.positionOf(values[key]) ?? values[key]}
      disabled={disabled}
      onChange={(position) => {
        const changes: Partial<Record<Key, number>> = {};
        changes[key] = scale?.valueOf(position) ?? position;
        change(changes);
      }}
    />
  ));
}
