import { Paper, Text, Title } from "@mantine/core";
import { Component, type ReactNode } from "react";

interface Props {
  children: ReactNode;
}

/** A browser that cannot draw the scene still has everything around it. */
export class SceneBoundary extends Component<Props, { reason: string }> {
  override state = { reason: "" };

  static getDerivedStateFromError(error: unknown): { reason: string } {
    return { reason: error instanceof Error ? error.message : String(error) };
  }

  override render(): ReactNode {
    const { reason } = this.state;
    if (reason === "") return this.props.children;
    return (
      <Paper className="situation" withBorder p="lg" role="alert">
        <Title order={4}>This browser cannot draw the scene</Title>
        <Text size="sm" mt="xs">
          The scene needs WebGL 2; all panels work without it. Browser error: {reason}
        </Text>
      </Paper>
    );
  }
}
