import { useComputedColorScheme } from "@mantine/core";
import { useEffect, useRef, type RefObject } from "react";
import { usePlots } from "../../state/plots.ts";
import type { Look } from "./axes.ts";
import { presentS } from "./recorder.ts";

const DRAW_MS = 50;
const LOOKS: Record<"light" | "dark", Look> = {
  light: { text: "#5c636a", grid: "#00000014" },
  dark: { text: "#a6adb4", grid: "#ffffff14" },
};

/** What is drawn of a plot. */
export interface Surface {
  /** Draw what lies between two times, s, or what was zoomed to. */
  draw(from: number, to: number): void;
  resize(width: number, height: number): void;
  showNewest(): void;
  destroy(): void;
}

export interface Drawn {
  container: RefObject<HTMLDivElement | null>;
  showNewest: () => void;
}

/**
 * Keep a drawing in an element up to date; while `paused` it shows what was the newest then.
 * `make` is called again whenever it is another function.
 */
export function useDrawing(
  make: (element: HTMLElement, look: Look) => Surface,
  paused: boolean,
): Drawn {
  const scheme = useComputedColorScheme();
  const container = useRef<HTMLDivElement>(null);
  const surface = useRef<Surface | null>(null);
  const still = useRef<number | null>(null);
  still.current = paused ? (still.current ?? presentS()) : null;

  useEffect(() => {
    const element = container.current!;
    const made = make(element, LOOKS[scheme]);
    surface.current = made;
    const sized = new ResizeObserver(([entry]) => {
      if (entry) made.resize(entry.contentRect.width, entry.contentRect.height);
    });
    sized.observe(element);
    const timer = setInterval(() => {
      const to = still.current ?? presentS();
      made.draw(to - usePlots.getState().windowS, to);
    }, DRAW_MS);
    return () => {
      clearInterval(timer);
      sized.disconnect();
      made.destroy();
    };
  }, [make, scheme]);

  return { container, showNewest: () => surface.current?.showNewest() };
}
