import { ActionIcon, Group, Paper, Text } from "@mantine/core";
import { Minus, Plus, X } from "lucide-react";
import { useRef, type KeyboardEvent, type PointerEvent, type ReactNode } from "react";
import { create } from "zustand";
import { moveTile, useLayout, type Tile } from "../state/layout.ts";

const MIN_PX = 140;
const STEP = 0.05;
const STEP_PX = 40;

/** The tile that was touched last lies over the others. */
const useFront = create(() => ({ name: "" }));

interface FloatingTileProps {
  /** Under which its position is stored. */
  name: string;
  title: string;
  usual: Tile;
  /** Fraction of the scene's width at most, until the user has moved the tile. */
  maxFraction?: number;
  /** Width over height of what is in it. */
  aspect: number;
  actions?: ReactNode;
  onClose?: () => void;
  children: ReactNode;
}

/** A small window over the scene: drag its title, pull its corner, or use the keys on the title. */
export function FloatingTile(props: FloatingTileProps) {
  const { name, title, usual, maxFraction = 1, aspect, actions, onClose, children } = props;
  const stored = useLayout((layout) => layout.tiles[name]);
  const tile = stored ?? usual;
  const box = useRef<HTMLDivElement>(null);
  const grip = useRef<{ x: number; y: number; tile: Tile } | null>(null);
  const inFront = useFront((front) => front.name === name);
  /** As it is on the screen: narrow scenes make tiles that were not moved smaller. */
  const present = () => ({ ...tile, width: box.current?.offsetWidth ?? tile.width });
  const raise = () => useFront.setState({ name });
  const move = (next: Tile) => moveTile(name, clamped(next));
  const begin = (event: PointerEvent) => {
    if ((event.target as HTMLElement).closest("button") !== null) return;
    event.currentTarget.setPointerCapture(event.pointerId);
    grip.current = { x: event.clientX, y: event.clientY, tile: present() };
  };
  const end = () => (grip.current = null);
  const drag = (event: PointerEvent) => {
    const from = grip.current;
    if (from === null) return;
    const room = roomOf(box.current!);
    const x = from.tile.x + (event.clientX - from.x) / room.width;
    const y = from.tile.y + (event.clientY - from.y) / room.height;
    move({ ...from.tile, x, y });
  };
  const pull = (event: PointerEvent) => {
    const from = grip.current;
    if (from === null) return;
    // The corner away from the nearer edge of the scene is pulled.
    const towards = from.tile.x > 0.5 ? -1 : 1;
    move({ ...from.tile, width: from.tile.width + towards * (event.clientX - from.x) });
  };
  const key = (event: KeyboardEvent) => {
    const steps: Record<string, Partial<Tile>> = {
      ArrowLeft: { x: tile.x - STEP },
      ArrowRight: { x: tile.x + STEP },
      ArrowUp: { y: tile.y - STEP },
      ArrowDown: { y: tile.y + STEP },
    };
    const step = steps[event.key];
    if (step === undefined || event.target !== event.currentTarget) return;
    event.preventDefault();
    event.stopPropagation();
    move({ ...present(), ...step });
  };
  return (
    <Paper
      ref={box}
      className="tile"
      shadow="md"
      withBorder
      role="group"
      aria-label={title}
      style={{ ...styleOf(tile), width: stored?.width ?? narrowed(usual.width, maxFraction) }}
      data-front={inFront || undefined}
      onPointerDownCapture={raise}
      onFocusCapture={raise}
    >
      <Group
        className="tile-title"
        gap={4}
        px={6}
        wrap="nowrap"
        justify="space-between"
        tabIndex={0}
        aria-label={`${title}: arrow keys move it`}
        onPointerDown={begin}
        onPointerMove={drag}
        onPointerUp={end}
        onKeyDown={key}
      >
        <Text size="xs" fw={600} truncate>
          {title}
        </Text>
        <Group gap={2} wrap="nowrap">
          {actions}
          <TileButton
            label={`${title}: smaller`}
            icon={<Minus size={14} />}
            press={() => move({ ...tile, width: present().width - STEP_PX })}
          />
          <TileButton
            label={`${title}: larger`}
            icon={<Plus size={14} />}
            press={() => move({ ...tile, width: present().width + STEP_PX })}
          />
          {onClose !== undefined && (
            <TileButton label={`Close ${title}`} icon={<X size={14} />} press={onClose} />
          )}
        </Group>
      </Group>
      <div className="tile-content" style={{ aspectRatio: aspect }}>
        {children}
      </div>
      <div
        className="tile-corner"
        data-side={tile.x > 0.5 ? "left" : "right"}
        onPointerDown={begin}
        onPointerMove={pull}
        onPointerUp={end}
      />
    </Paper>
  );
}

function TileButton({ label, icon, press }: { label: string; icon: ReactNode; press: () => void }) {
  return (
    <ActionIcon size="sm" variant="subtle" color="gray" aria-label={label} onClick={press}>
      {icon}
    </ActionIcon>
  );
}

/** Of the scene, what is left beside the tile. */
function roomOf(box: HTMLElement): { width: number; height: number } {
  const scene = box.parentElement!;
  return {
    width: Math.max(1, scene.clientWidth - box.offsetWidth),
    height: Math.max(1, scene.clientHeight - box.offsetHeight),
  };
}

/** A tile at a share of 0 touches one edge, at 1 the other, however large the scene is. */
function styleOf({ x, y }: Tile): React.CSSProperties {
  return {
    left: `${100 * x}%`,
    top: `${100 * y}%`,
    transform: `translate(${-100 * x}%, ${-100 * y}%)`,
  };
}

/** CSS width of so many pixels, or less where the scene is narrow. */
function narrowed(width: number, maxFraction: number): string {
  return `max(${MIN_PX}px, min(${width}px, ${100 * maxFraction}%))`;
}

function clamped({ x, y, width }: Tile): Tile {
  const share = (value: number) => Math.max(0, Math.min(1, value));
  const maxPx = Math.max(MIN_PX, window.innerWidth - 80);
  return { x: share(x), y: share(y), width: Math.max(MIN_PX, Math.min(width, maxPx)) };
}
