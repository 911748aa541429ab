import { ActionIcon, Tooltip, useMantineColorScheme } from "@mantine/core";
import { Moon, Sun, SunMoon } from "lucide-react";

const NEXT = { auto: "light", light: "dark", dark: "auto" } as const;
const NAMES = { auto: "system", light: "light", dark: "dark" };
const ICONS = { auto: SunMoon, light: Sun, dark: Moon };

/** Light, dark, or system has it. */
export function ColourScheme() {
  const { colorScheme, setColorScheme } = useMantineColorScheme();
  const Icon = ICONS[colorScheme];
  const label = `Colours: ${NAMES[colorScheme]}`;
  return (
    <Tooltip label={label}>
      <ActionIcon
        variant="subtle"
        size="lg"
        aria-label={label}
        onClick={() => setColorScheme(NEXT[colorScheme])}
      >
        <Icon size={18} />
      </ActionIcon>
    </Tooltip>
  );
}
