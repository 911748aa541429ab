import { Fieldset, Group, NumberInput, Stack, Switch, Textarea, TextInput } from "@mantine/core";
import { useState } from "react";
import { isNumeric, isTruth, type Field } from "../../lib/typeDefinitions.ts";

type Value = Record<string, unknown>;

interface MessageFormProps {
  fields: readonly Field[];
  value: Value;
  onChange: (value: Value) => void;
}

/** So many numbers stand side by side: the parts of a point or of a quaternion. */
const MAX_IN_A_ROW = 4;

/** A form for any type, made of its description. */
export function MessageForm({ fields, value, onChange }: MessageFormProps) {
  const inputs = fields.map((field) => (
    <FieldInput
      key={field.name}
      field={field}
      value={value[field.name]}
      onChange={(changed) => onChange({ ...value, [field.name]: changed })}
    />
  ));
  const row =
    fields.length <= MAX_IN_A_ROW && fields.every(({ type, array }) => !array && isNumeric(type));
  if (!row) return <Stack gap={6}>{inputs}</Stack>;
  return (
    <Group gap={6} wrap="nowrap" align="start" grow>
      {inputs}
    </Group>
  );
}

interface FieldInputProps {
  field: Field;
  value: unknown;
  onChange: (value: unknown) => void;
}

function FieldInput({ field, value, onChange }: FieldInputProps) {
  if (field.array) return <ArrayInput field={field} value={value} onChange={onChange} />;
  if (field.fields !== null) {
    return (
      <Fieldset legend={field.name} p="xs">
        <MessageForm fields={field.fields} value={(value ?? {}) as Value} onChange={onChange} />
      </Fieldset>
    );
  }
  if (isTruth(field.type)) {
    return (
      <Switch
        label={field.name}
        checked={value === true}
        onChange={(event) => onChange(event.currentTarget.checked)}
      />
    );
  }
  if (isNumeric(field.type)) return <Numeric field={field} value={value} onChange={onChange} />;
  return (
    <TextInput
      label={field.name}
      size="xs"
      value={String(value ?? "")}
      onChange={(event) => onChange(event.currentTarget.value)}
    />
  );
}

function Numeric({ field, value, onChange }: FieldInputProps) {
  const names = field.constants.map(({ name, value: meant }) => `${meant} ${name}`).join(" · ");
  return (
    <NumberInput
      label={field.name}
      size="xs"
      description={names}
      allowDecimal={field.type.startsWith("float")}
      value={value as number}
      onChange={(changed) => onChange(changed === "" ? 0 : changed)}
    />
  );
}

/** Arrays are written as JSON. */
function ArrayInput({ field, value, onChange }: FieldInputProps) {
  const [text, setText] = useState(() => JSON.stringify(value ?? []));
  const [wrong, setWrong] = useState(false);
  const write = (written: string) => {
    setText(written);
    const read = arrayOf(written);
    setWrong(read === null);
    if (read !== null) onChange(read);
  };
  return (
    <Textarea
      label={`${field.name} (${field.type}[], as JSON)`}
      size="xs"
      autosize
      maxRows={6}
      value={text}
      error={wrong ? "not a JSON array" : undefined}
      onChange={(event) => write(event.currentTarget.value)}
    />
  );
}

function arrayOf(text: string): unknown[] | null {
  try {
    const read: unknown = JSON.parse(text);
    return Array.isArray(read) ? read : null;
  } catch {
    return null;
  }
}
