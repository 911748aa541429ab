import { ActionIcon, Button, Group, Text, TextInput } from "@mantine/core";
import { LayoutPanelLeft, Trash2 } from "lucide-react";
import { useState } from "react";
import { resetLayout } from "../../state/layout.ts";
import {
  deleteLayout,
  restoreLayout,
  saveLayout,
  useSavedLayouts,
} from "../../state/savedLayouts.ts";
import { TopPopover } from "./TopPopover.tsx";

const MAX_CHARACTERS = 40;

/** Saves the arrangement of panels, tiles and plots under a name, and restores it. */
export function Layouts() {
  const [opened, setOpened] = useState(false);
  const names = useSavedLayouts(({ saved }) => Object.keys(saved).sort().join("\n"));
  const restore = (name: string) => {
    restoreLayout(name);
    setOpened(false);
  };
  return (
    <TopPopover
      label="Layouts"
      icon={<LayoutPanelLeft size={18} />}
      position="bottom-end"
      width={290}
      opened={opened}
      onChange={setOpened}
      variant="subtle"
      visibleFrom="sm"
    >
      <NewLayout />
      {names.split("\n").map((name) => name !== "" && <Saved key={name} {...{ name, restore }} />)}
      <Button variant="subtle" size="compact-sm" onClick={resetLayout}>
        Default layout
      </Button>
      <Text size="xs" c="dimmed">
        This browser stores panels, sizes, tiles and plots.
      </Text>
    </TopPopover>
  );
}

function NewLayout() {
  const [name, setName] = useState("");
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        saveLayout(name.trim());
        setName("");
      }}
    >
      <Group gap="xs" wrap="nowrap">
        <TextInput
          flex={1}
          aria-label="Name of the layout"
          placeholder="Name"
          maxLength={MAX_CHARACTERS}
          value={name}
          onChange={(event) => setName(event.currentTarget.value)}
        />
        <Button type="submit" disabled={name.trim() === ""}>
          Save
        </Button>
      </Group>
    </form>
  );
}

function Saved({ name, restore }: { name: string; restore: (name: string) => void }) {
  return (
    <Group gap="xs" wrap="nowrap">
      <Button
        flex={1}
        variant="subtle"
        justify="start"
        size="compact-md"
        aria-label={`Restore ${name}`}
        onClick={() => restore(name)}
      >
        {name}
      </Button>
      <ActionIcon
        variant="subtle"
        color="gray"
        aria-label={`Delete ${name}`}
        onClick={() => deleteLayout(name)}
      >
        <Trash2 size={16} />
      </ActionIcon>
    </Group>
  );
}
