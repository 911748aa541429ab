import { ActionIcon, Group, Tooltip } from "@mantine/core";
import { LocateFixed, Maximize, Navigation } from "lucide-react";
import { useWhyNot } from "../../state/rights.ts";

interface MapButtonsProps {
  fit: () => void;
  follows: boolean;
  setFollows: (follows: boolean) => void;
  clickSends: boolean;
  setClickSends: (sends: boolean) => void;
}

/** What a click on the map does, and what the map shows. */
export function MapButtons({
  fit,
  follows,
  setFollows,
  clickSends,
  setClickSends,
}: MapButtonsProps) {
  const whyNot = useWhyNot();
  const buttons = [
    {
      label: "Send the selected UAV by click",
      icon: <Navigation size={15} />,
      pressed: clickSends,
      disabled: whyNot !== null,
      press: () => setClickSends(!clickSends),
    },
    {
      label: "Follow the selected UAV",
      icon: <LocateFixed size={15} />,
      pressed: follows,
      disabled: false,
      press: () => setFollows(!follows),
    },
    {
      label: "Show all",
      icon: <Maximize size={15} />,
      pressed: false,
      disabled: false,
      press: fit,
    },
  ];
  return (
    <Group gap={2} wrap="nowrap">
      {buttons.map(({ label, icon, pressed, disabled, press }) => (
        <Tooltip key={label} label={label}>
          <ActionIcon
            size="sm"
            variant={pressed ? "filled" : "subtle"}
            aria-label={label}
            aria-pressed={pressed}
            disabled={disabled}
            onClick={press}
          >
            {icon}
          </ActionIcon>
        </Tooltip>
      ))}
    </Group>
  );
}
