import { Button, Paper, Text } from "@mantine/core";
import { givePosition, useTool } from "../state/tool.ts";

/** Says that a click is being waited for. */
export function Picking() {
  const asking = useTool((tool) => tool.asking);
  if (asking === null) return null;
  return (
    <Paper className="picking" shadow="md" withBorder px="md" py={6} role="status">
      <Text size="sm">{asking}: click the ground or the map</Text>
      <Button size="compact-xs" variant="subtle" onClick={() => givePosition(null)}>
        Cancel (Esc)
      </Button>
    </Paper>
  );
}
