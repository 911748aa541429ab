import { Group, Kbd, Modal, Stack, Text, Title } from "@mantine/core";
import { HOTKEYS } from "../state/hotkeys.ts";
import { closeWindow } from "../state/windows.ts";

/** All keys. */
export default function Help() {
  return (
    <Modal opened onClose={closeWindow} title="Keyboard shortcuts" size="xl">
      <div className="keys">
        {HOTKEYS.map(({ title, keys }) => (
          <Stack key={title} gap={6} mb="lg" className="keys-group">
            <Title order={5}>{title}</Title>
            {keys.map((key) => (
              <Group key={key.text} justify="space-between" wrap="nowrap" gap="sm">
                <Text size="sm">{key.text}</Text>
                <Group gap={4} wrap="nowrap">
                  {key.keys.map((name) => (
                    <Kbd key={name}>{name}</Kbd>
                  ))}
                </Group>
              </Group>
            ))}
          </Stack>
        ))}
      </div>
    </Modal>
  );
}
