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
      { keys: ["[", "]"], text: "Select the previous, the next UAV" },
      {
        keys: ["Ctrl", "drag"],
        text: "Select the UAVs in a box; Ctrl and a click: one more or less",
      },
      { keys: ["T"], text: "Take off" },
      { keys: ["H"], text: "Hold position" },
      { keys: ["L"], text: "Land" },
      { keys: ["B"], text: "Return home" },
      { keys: ["G"], text: "Go to a clicked position" },
      { keys: ["V"], text: "Move by dragging, on and off" },
    ],
  },
  {
    title: "Manual control",
    keys: [
      { keys: ["C"], text: "Start, stop manual control" },
      { keys: ["W", "S"], text: "Forward, back" },
      { keys: ["A", "D"], text: "Left, right" },
      { keys: ["R", "F"], text: "Up, down (also page up, page down)" },
      { keys: ["Q", "E"], text: "Yaw left, right (also arrows)" },
      { keys: ["Shift"], text: "Twice as fast" },
      { keys: ["Gamepad"], text: "Left stick: climb, yaw; right stick: forward, lateral" },
    ],
  },
  {
    title: "Views",
    keys: [
      { keys: ["1", "…", "5"], text: "Orbit, walk, fly, chase, on board" },
      {
        keys: ["W", "A", "S", "D"],
        text: "Move in the views walk and fly through, outside manual control",
      },
    ],
  },
  {
    title: "Page",
    keys: [
      { keys: ["M"], text: "Map" },
      { keys: ["P"], text: "Cameras" },
      { keys: ["?"], text: "Keyboard shortcuts" },
      { keys: ["Esc"], text: "Stop manual control, cancel, close" },
    ],
  },
];
