import { Group, Kbd, Modal, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { HOTKEYS } from "../state/hotkeys.ts";
import { closeWindow } from "../state/windows.ts";

/** All keys. */
export default function Help() {
  return (
    <Modal opened onClose={closeWindow} title="Keys" size="xl">
      <SimpleGrid cols={{ base: 1, sm: 2 }} spacing="xl">
        {HOTKEYS.map(({ title, keys }) => (
          <Stack key={title} gap={6}>
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
      </SimpleGrid>
    </Modal>
  );
}
