import { ActionIcon, Button, Group, Popover, Stack, Text, TextInput, Tooltip } from "@mantine/core";
import { LayoutPanelLeft, Trash2 } from "lucide-react";
import { useState } from "react";
import { resetLayout } from "../../state/layout.ts";
import {
  deleteLayout,
  restoreLayout,
  saveLayout,
  useSavedLayouts,
} from "../../state/savedLayouts.ts";

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
    <Popover opened={opened} onChange={setOpened} position="bottom-end" withArrow trapFocus>
      <Popover.Target>
        <Tooltip label="Layouts" disabled={opened}>
          <ActionIcon
            variant="subtle"
            size="lg"
            visibleFrom="sm"
            aria-label="Layouts"
            onClick={() => setOpened(!opened)}
          >
            <LayoutPanelLeft size={18} />
          </ActionIcon>
        </Tooltip>
      </Popover.Target>
      <Popover.Dropdown w={290}>
        <Stack gap="xs">
          <NewLayout />
          {names
            .split("\n")
            .map((name) => name !== "" && <Saved key={name} {...{ name, restore }} />)}
          <Button variant="subtle" size="compact-sm" onClick={resetLayout}>
            Default layout
          </Button>
          <Text size="xs" c="dimmed">
            This browser stores panels, sizes, tiles and plots.
          </Text>
        </Stack>
      </Popover.Dropdown>
    </Popover>
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
