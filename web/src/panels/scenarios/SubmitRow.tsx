import { Group, Text } from "@mantine/core";
import type { ReactNode } from "react";

interface SubmitRowProps {
  /** Why submitting is off; null: it is not. */
  whyNot: string | null;
  justify: "end" | "space-between";
  children: ReactNode;
}

/** The buttons at the foot of a form, and why they are off. */
export function SubmitRow({ whyNot, justify, children }: SubmitRowProps) {
  return (
    <>
      <Group justify={justify} mt="xs">
        {children}
      </Group>
      {whyNot !== null && (
        <Text size="xs" c="dimmed" ta="right">
          {whyNot}
        </Text>
      )}
    </>
  );
}
