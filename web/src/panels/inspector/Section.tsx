import { Divider, Stack, Title } from "@mantine/core";
import type { ReactNode } from "react";

/** A titled part of the inspector. */
export function Section({ title, children }: { title: string; children: ReactNode }) {
  return (
    <Stack gap={6} component="section" aria-label={title}>
      <Divider />
      <Title order={6} component="h3">
        {title}
      </Title>
      {children}
    </Stack>
  );
}
