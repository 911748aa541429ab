import { Button, Group, Stack, Text } from "@mantine/core";
import { clockText } from "../../lib/time.ts";
import { endFault } from "../../link/commands.ts";
import { faultText, type ActiveFault } from "../../lib/activeFaults.ts";
import { useFaults } from "../../state/faults.ts";
import { succeeds } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";

/** What is broken now, each with a button that ends it. */
export function ActiveFaults() {
  const active = useFaults((faults) => faults.active);
  const whyNot = useWhyNot();
  if (active.length === 0) return null;
  return (
    <Stack gap={4} role="list" aria-label="Active faults">
      {active.map((fault, i) => (
        <Group key={`${i} ${JSON.stringify(fault)}`} gap="xs" role="listitem" wrap="nowrap">
          <Text size="xs" flex={1}>
            {fault.uav !== undefined && <b>{fault.uav} </b>}
            {faultText(fault)} · {spanOf(fault)}
          </Text>
          <Button
            size="compact-xs"
            variant="default"
            disabled={whyNot !== null}
            aria-label={`End ${faultText(fault)}${fault.uav === undefined ? "" : ` of ${fault.uav}`}`}
            onClick={() => void succeeds("End of the fault", endFault(fault))}
          >
            End
          </Button>
        </Group>
      ))}
    </Stack>
  );
}

function spanOf({ at_s, until_s }: ActiveFault): string {
  const since = `since ${clockText(at_s)}`;
  return until_s === undefined ? since : `${since}, until ${clockText(until_s)}`;
}
