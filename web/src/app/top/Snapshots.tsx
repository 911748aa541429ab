import { ActionIcon, Button, Group, ScrollArea, Stack, Text, TextInput } from "@mantine/core";
import { Bookmark, Trash2, Undo2 } from "lucide-react";
import { useState } from "react";
import { clockText } from "../../lib/time.ts";
import {
  deleteSnapshot,
  saveSnapshot,
  listSnapshots,
  restoreSnapshot,
  type Snapshot,
} from "../../link/commands.ts";
import { attempt, succeeds, showSuccess } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { TopPopover } from "./TopPopover.tsx";

/** States of the whole simulation to return to. */
export function Snapshots() {
  const [opened, setOpened] = useState(false);
  const [states, setStates] = useState<Snapshot[]>([]);
  const refresh = async () => setStates((await attempt("Snapshots", listSnapshots())) ?? []);
  const open = (next: boolean) => {
    setOpened(next);
    if (next) void refresh();
  };
  return (
    <TopPopover
      label="Snapshots"
      icon={<Bookmark size={18} />}
      position="bottom-end"
      width={310}
      opened={opened}
      onChange={open}
    >
      <NewState taken={states.map(({ name }) => name)} onKept={() => void refresh()} />
      {states.length === 0 ? (
        <Text size="sm" c="dimmed">
          No snapshots. A snapshot holds the whole simulation: UAVs, weather, noise and node states.
        </Text>
      ) : (
        <ScrollArea.Autosize mah={280}>
          <Stack gap={2} component="ul" p={0} m={0} aria-label="Snapshots">
            {states.map((state) => (
              <State key={state.name} state={state} onForgotten={() => void refresh()} />
            ))}
          </Stack>
        </ScrollArea.Autosize>
      )}
    </TopPopover>
  );
}

function NewState({ taken, onKept }: { taken: string[]; onKept: () => void }) {
  const [name, setName] = useState("");
  const whyNot = useWhyNot();
  const take = async () => {
    const wished = name.trim() || freeName(taken);
    if (!(await succeeds("Snapshot", saveSnapshot(wished)))) return;
    setName("");
    onKept();
  };
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        void take();
      }}
    >
      <Group gap="xs" wrap="nowrap">
        <TextInput
          flex={1}
          aria-label="Name of the snapshot"
          placeholder={freeName(taken)}
          maxLength={100}
          value={name}
          onChange={(event) => setName(event.currentTarget.value)}
        />
        <Button type="submit" disabled={whyNot !== null}>
          Save
        </Button>
      </Group>
    </form>
  );
}

function State({
  state: { name, timeS },
  onForgotten,
}: {
  state: Snapshot;
  onForgotten: () => void;
}) {
  const whyNot = useWhyNot();
  const goBack = async () => {
    if (await succeeds("Snapshot", restoreSnapshot(name)))
      showSuccess(`Restored the state at ${clockText(timeS)}`);
  };
  return (
    <Group component="li" gap="xs" wrap="nowrap" style={{ listStyle: "none" }}>
      <Button
        flex={1}
        variant="subtle"
        justify="space-between"
        size="compact-md"
        disabled={whyNot !== null}
        leftSection={<Undo2 size={16} />}
        rightSection={<Text ff="monospace">{clockText(timeS)}</Text>}
        aria-label={`Restore ${name}`}
        onClick={() => void goBack()}
      >
        {name}
      </Button>
      <ActionIcon
        variant="subtle"
        color="gray"
        aria-label={`Delete ${name}`}
        disabled={whyNot !== null}
        onClick={() => void succeeds("Snapshot", deleteSnapshot(name)).then(onForgotten)}
      >
        <Trash2 size={16} />
      </ActionIcon>
    </Group>
  );
}

function freeName(taken: readonly string[]): string {
  let number = 1;
  while (taken.includes(`snapshot ${number}`)) number++;
  return `snapshot ${number}`;
}
