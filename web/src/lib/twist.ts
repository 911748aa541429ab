// Manual control: what keys, sticks and a gamepad ask for, as a velocity in the level heading frame.

/** Shares of the full speed, each -1..1: ahead, left, up, and turning left. */
export interface Wish {
  ahead: number;
  left: number;
  up: number;
  turn: number;
}

export interface Speeds {
  /** m/s, over the ground. */
  level: number;
  /** m/s */
  climb: number;
  /** rad/s */
  turn: number;
}

export const AT_REST: Wish = { ahead: 0, left: 0, up: 0, turn: 0 };

/** Smaller deflections of a stick are noise. */
export const DEAD_ZONE = 0.12;

const KEYS: Readonly<Record<string, Partial<Wish>>> = {
  KeyW: { ahead: 1 },
  KeyS: { ahead: -1 },
  KeyA: { left: 1 },
  KeyD: { left: -1 },
  KeyR: { up: 1 },
  KeyF: { up: -1 },
  KeyQ: { turn: 1 },
  KeyE: { turn: -1 },
  ArrowUp: { ahead: 1 },
  ArrowDown: { ahead: -1 },
  ArrowLeft: { turn: 1 },
  ArrowRight: { turn: -1 },
  PageUp: { up: 1 },
  PageDown: { up: -1 },
};

export function isFlightKey(code: string): boolean {
  return code in KEYS;
}

/** What the pressed keys (`KeyboardEvent.code`) ask for together. */
export function wishOfKeys(pressed: Iterable<string>): Wish {
  return sum([...pressed].map((code) => KEYS[code] ?? {}));
}

/** Mode 2: the left stick climbs and turns, the right one flies ahead and aside. */
export function wishOfSticks(
  left: readonly [number, number],
  right: readonly [number, number],
): Wish {
  const [turn, up] = live(left);
  const [aside, ahead] = live(right);
  // Sticks count to the right and downwards.
  return { ahead: -ahead || 0, left: -aside || 0, up: -up || 0, turn: -turn || 0 };
}

/** All of them at once, none beyond full. */
export function sum(wishes: readonly Partial<Wish>[]): Wish {
  const of = (axis: keyof Wish) =>
    Math.max(
      -1,
      Math.min(
        1,
        wishes.reduce((all, wish) => all + (wish[axis] ?? 0), 0),
      ),
    );
  return { ahead: of("ahead"), left: of("left"), up: of("up"), turn: of("turn") };
}

export function isAtRest({ ahead, left, up, turn }: Wish): boolean {
  return ahead === 0 && left === 0 && up === 0 && turn === 0;
}

/** As `geometry_msgs/Twist`; flying slantwise is not faster than straight ahead. */
export function twistOf({ ahead, left, up, turn }: Wish, speeds: Speeds) {
  const scale = speeds.level / Math.max(1, Math.hypot(ahead, left));
  return {
    linear: { x: ahead * scale, y: left * scale, z: up * speeds.climb },
    angular: { x: 0, y: 0, z: turn * speeds.turn },
  };
}

/** A stick without its dead zone: 0 at its edge, full at the rim. */
function live([x, y]: readonly [number, number]): [number, number] {
  const deflection = Math.hypot(x, y);
  if (deflection <= DEAD_ZONE) return [0, 0];
  const share = Math.min(1, (deflection - DEAD_ZONE) / (1 - DEAD_ZONE)) / deflection;
  return [x * share, y * share];
}
