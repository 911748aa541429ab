/** A key and what it does; the help and the page read the same list. */
export interface Hotkey {
  /** As shown. */
  keys: string[];
  text: string;
}

export interface HotkeyGroup {
  title: string;
  keys: Hotkey[];
}

export const HOTKEYS: readonly HotkeyGroup[] = [
  {
    title: "Time",
    keys: [
      { keys: ["Space"], text: "Play, pause" },
      { keys: ["."], text: "One physics step, while paused" },
      { keys: ["+", "-"], text: "Faster, slower" },
    ],
  },
  {
    title: "UAVs",
    keys: [
      { keys: ["[", "]"], text: "Select the one before, the next" },
      { keys: ["T"], text: "Take off" },
      { keys: ["H"], text: "Hold its position" },
      { keys: ["L"], text: "Land" },
      { keys: ["B"], text: "Return home" },
      { keys: ["G"], text: "Go to a position: click on it" },
      { keys: ["V"], text: "Move by dragging, on and off" },
    ],
  },
  {
    title: "Manual control",
    keys: [
      { keys: ["C"], text: "Take the controls, give them back" },
      { keys: ["W", "S"], text: "Forward, back" },
      { keys: ["A", "D"], text: "Left, right" },
      { keys: ["R", "F"], text: "Up, down (also page up, page down)" },
      { keys: ["Q", "E"], text: "Turn left, right (also arrows)" },
      { keys: ["Shift"], text: "Twice as fast" },
      { keys: ["Gamepad"], text: "Left stick: climb, turn; right stick: forward, lateral" },
    ],
  },
  {
    title: "Views",
    keys: [
      { keys: ["1", "…", "5"], text: "Orbit, walk, fly, chase, on board" },
      { keys: ["W", "A", "S", "D"], text: "Walk and fly through, while no controls are taken" },
    ],
  },
  {
    title: "Page",
    keys: [
      { keys: ["M"], text: "Map" },
      { keys: ["P"], text: "Cameras" },
      { keys: ["?"], text: "These keys" },
      { keys: ["Esc"], text: "Give the controls back, cancel, close" },
    ],
  },
];
