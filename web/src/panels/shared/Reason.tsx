import { Text } from "@mantine/core";

/** Why something could not be done; nothing where all is well. */
export function Reason({ children }: { children: string }) {
  if (children === "") return null;
  return (
    <Text c="red" size="sm" role="alert">
      {children}
    </Text>
  );
}
