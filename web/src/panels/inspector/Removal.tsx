import { Button, Tooltip } from "@mantine/core";
import { Trash2 } from "lucide-react";
import { remove } from "../../link/commands.ts";
import { succeeds, showSuccess } from "../../state/notices.ts";
import { useConnection } from "../../state/connection.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useVehicles } from "../../state/vehicles.ts";

/** Take a UAV out of the world; the last one stays. */
export function Removal({ uav }: { uav: string }) {
  const alone = useVehicles(({ list }) => list.length < 2);
  const volery = useConnection((connection) => connection.volery);
  const whyNot = useWhyNot() ?? (alone ? "A simulation needs at least one UAV" : null);
  if (!volery) return null;
  const take = async () => {
    if (await succeeds(`Remove ${uav}`, remove(uav))) showSuccess(`Removed ${uav}`);
  };
  return (
    <Tooltip label={whyNot ?? "Remove this UAV from the simulation"}>
      <Button
        variant="subtle"
        color="red"
        size="compact-sm"
        leftSection={<Trash2 size={15} />}
        disabled={whyNot !== null}
        onClick={() => void take()}
      >
        Remove {uav}
      </Button>
    </Tooltip>
  );
}
