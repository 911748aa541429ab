import { Button } from "@mantine/core";
import { select, useVehicles } from "../../state/vehicles.ts";
import { look } from "../../state/view.ts";

/** Name of a UAV; a click follows it. */
export function JumpTo({ uav }: { uav: string }) {
  const known = useVehicles(({ list }) => list.some(({ name }) => name === uav));
  if (!known) return <span>{uav}</span>;
  return (
    <Button
      size="compact-xs"
      variant="subtle"
      aria-label={`Go to ${uav}`}
      onClick={() => {
        select(uav);
        look("chase");
      }}
    >
      {uav}
    </Button>
  );
}
