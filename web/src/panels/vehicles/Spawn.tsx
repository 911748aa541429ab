import { Button, Group, NumberInput, Paper, Select, Stack, Text } from "@mantine/core";
import { MousePointerClick } from "lucide-react";
import { useEffect, useState } from "react";
import { spawn, spawnables, type Position, type Spawnable } from "../../link/commands.ts";
import { attempt, showSuccess } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { pickPosition } from "../../state/tool.ts";
import { select, useVehicles } from "../../state/vehicles.ts";
import { heightAt } from "../../state/worldPlan.ts";
import { spiral } from "./spiral.ts";

const SPACING_M = 2;
/** Positions that are tried for each UAV where some are taken. */
const TRIES = 12;

/** New UAVs of any airframe: where one clicks, or wherever there is room. */
export function Spawn({ close }: { close: () => void }) {
  const [offered, setOffered] = useState<Spawnable[]>([]);
  const [uri, setUri] = useState<string | null>(null);
  const [count, setCount] = useState(1);
  const [busy, setBusy] = useState(false);
  const whyNot = useWhyNot();
  useEffect(() => {
    void attempt("Add UAVs", spawnables()).then((list) => {
      setOffered(list ?? []);
      setUri(list?.[0]?.uri ?? null);
    });
  }, []);
  const add = async (around: { x: number; y: number }) => {
    setBusy(true);
    const came = await attempt("Add UAVs", spawnAround(uri!, count, around));
    setBusy(false);
    if (came === null) return;
    showSuccess(came.length === 1 ? `Added ${came[0]}` : `Added ${came.length} UAVs`);
    select(came[0]!);
    close();
  };
  const byClick = async () => {
    const position = await pickPosition(count === 1 ? "New UAV" : `${count} new UAVs`);
    if (position !== null) await add(position);
  };
  const disabled = whyNot !== null || uri === null || busy;
  return (
    <Paper withBorder mx="sm" mb="sm" p="sm" role="group" aria-label="Add UAVs">
      <Stack gap="xs">
        <Select
          label="Airframe or type"
          data={offered.map((each) => each.uri)}
          value={uri}
          onChange={setUri}
          searchable
          allowDeselect={false}
        />
        <Text size="xs" c="dimmed">
          {offered.find((each) => each.uri === uri)?.description}
        </Text>
        <NumberInput
          label="Count"
          min={1}
          max={256}
          allowDecimal={false}
          value={count}
          onChange={(value) => setCount(Math.max(1, Math.min(256, Number(value))))}
        />
        <Group gap="xs" grow preventGrowOverflow={false}>
          <Button
            disabled={disabled}
            variant="default"
            px="xs"
            leftSection={<MousePointerClick size={16} />}
            onClick={() => void byClick()}
          >
            Click position
          </Button>
          <Button disabled={disabled} loading={busy} onClick={() => void add(nearFleet())}>
            Add
          </Button>
        </Group>
        <Text size="xs" c="dimmed">
          {whyNot ??
            "New UAVs start at free positions near the selected UAV or the clicked position."}
        </Text>
      </Stack>
    </Paper>
  );
}

/** Try positions ever farther away until all have come; what came, else the last reason. */
async function spawnAround(uri: string, count: number, around: { x: number; y: number }) {
  const positions = spiral(count * TRIES, SPACING_M).map(([dx, dy]): Position => {
    const [x, y] = [around.x + dx, around.y + dy];
    return { x, y, z: heightAt(x, y) };
  });
  const came: string[] = [];
  let refused: unknown = null;
  while (came.length < count && positions.length > 0) {
    const next = positions.splice(0, count - came.length);
    try {
      came.push(...(await spawn(uri, next)));
    } catch (error) {
      refused = error;
    }
  }
  if (came.length === 0) throw refused;
  return came;
}

/** Beside the selected UAV. */
function nearFleet(): { x: number; y: number } {
  const { list, selected } = useVehicles.getState();
  const near = list.find(({ name }) => name === selected) ?? list[0];
  if (near === undefined) return { x: 0, y: 0 };
  return { x: near.position.x + SPACING_M, y: near.position.y };
}
