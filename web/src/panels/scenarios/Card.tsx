import { Badge, Group, Text, UnstyledButton } from "@mantine/core";
import { Building2, Grid3x3, Mountain, Trees } from "lucide-react";
import { contentsOf } from "../../lib/cardText.ts";
import type { ScenarioCard } from "../../link/commands.ts";

const ICONS = { forest: Trees, city: Building2, grid_map: Grid3x3, open: Mountain };

interface CardProps {
  card: ScenarioCard;
  present: boolean;
  choose: () => void;
}

/** A scenario as an image, its name in words and what flies there. */
export function Card({ card, present, choose }: CardProps) {
  const { name, title, description, picture, world, uploaded, missing } = card;
  const contents = contentsOf(card);
  const Icon = ICONS[world] ?? Mountain;
  return (
    <UnstyledButton
      className="card"
      onClick={choose}
      aria-label={`${name}: ${title}. ${description}`}
      data-present={present || undefined}
    >
      <div className="card-image">
        {picture === null ? (
          <Icon size={44} strokeWidth={1.2} aria-hidden />
        ) : (
          <img src={picture} alt="" loading="lazy" />
        )}
      </div>
      <div className="card-text">
        <Group gap={6} wrap="nowrap" justify="space-between">
          <Text fw={600} size="sm" className="card-title">
            {title}
          </Text>
          {present && <Badge size="xs">running</Badge>}
          {uploaded && (
            <Badge size="xs" variant="light">
              uploaded
            </Badge>
          )}
        </Group>
        {missing !== "" && (
          <Text size="xs" c="orange" className="reason">
            {missing}
          </Text>
        )}
        <Text size="xs" c="dimmed" className="reason">
          {description}
        </Text>
        <Text size="xs" mt={4}>
          {contents.uavs}
        </Text>
        <Text size="xs">{contents.sensors}</Text>
        <Text size="xs">{contents.world}</Text>
      </div>
    </UnstyledButton>
  );
}
