import { TextInput, type TextInputProps } from "@mantine/core";
import { Search } from "lucide-react";

interface FilterInputProps extends Omit<TextInputProps, "label" | "value" | "onChange"> {
  label: string;
  value: string;
  onChange: (value: string) => void;
}

/** The search field above a list; other properties are those of Mantine's text field. */
export function FilterInput({ label, size = "xs", onChange, ...rest }: FilterInputProps) {
  return (
    <TextInput
      {...rest}
      size={size}
      leftSection={<Search size={size === "xs" ? 14 : 16} />}
      aria-label={label}
      onChange={(event) => onChange(event.currentTarget.value)}
    />
  );
}
