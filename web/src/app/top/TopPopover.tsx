import { ActionIcon, Popover, Stack, Tooltip, type ActionIconProps } from "@mantine/core";
import type { ReactNode } from "react";

interface TopPopoverProps extends ActionIconProps {
  label: string;
  /** The tooltip, where it is not the label. */
  hint?: string;
  icon: ReactNode;
  position: "bottom" | "bottom-end";
  width: number;
  opened: boolean;
  onChange: (opened: boolean) => void;
  children: ReactNode;
}

/** A button of the top bar that opens a small form; other properties are those of the button. */
export function TopPopover(props: TopPopoverProps) {
  const { label, hint, icon, position, width, opened, onChange, children, ...button } = props;
  return (
    <Popover opened={opened} onChange={onChange} position={position} withArrow trapFocus>
      <Popover.Target>
        <Tooltip label={hint ?? label} disabled={opened}>
          <ActionIcon
            variant="default"
            size="lg"
            {...button}
            aria-label={label}
            onClick={() => onChange(!opened)}
          >
            {icon}
          </ActionIcon>
        </Tooltip>
      </Popover.Target>
      <Popover.Dropdown w={width}>
        <Stack gap="xs">{children}</Stack>
      </Popover.Dropdown>
    </Popover>
  );
}
