import { Button, Tooltip } from "@mantine/core";
import { Wrench } from "lucide-react";
import { useState } from "react";
import { resetUav } from "../../link/commands.ts";
import { useConnection } from "../../state/connection.ts";
import { succeeds, showSuccess } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { useVehicles } from "../../state/vehicles.ts";

/** Puts a crashed UAV back to its start while the others fly on. */
export function Repair({ uav }: { uav: string }) {
  const crashed = useVehicles(
    ({ list }) => list.find(({ name }) => name === uav)?.crashed ?? false,
  );
  const volery = useConnection((connection) => connection.volery);
  const whyNot = useWhyNot();
  const [busy, setBusy] = useState(false);
  if (!volery || !crashed) return null;
  const repair = async () => {
    setBusy(true);
    if (await succeeds(`Repair ${uav}`, resetUav(uav))) showSuccess(`Repaired ${uav}`);
    setBusy(false);
  };
  return (
    <Tooltip
      label={whyNot ?? "Repairs and charges the UAV and resets its sensors; other UAVs continue"}
    >
      <Button
        color="orange"
        leftSection={<Wrench size={16} />}
        disabled={whyNot !== null}
        loading={busy}
        onClick={() => void repair()}
      >
        Repair and return to start
      </Button>
    </Tooltip>
  );
}
