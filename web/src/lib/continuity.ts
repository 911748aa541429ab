/** What a view of a run is about; it continues another one where nothing has jumped. */
export interface Instant {
  /** Name of the scenario; null where it is not known. */
  scenario: string | null;
  /** Simulated time, or the position in a log, s. */
  timeS: number;
  /** Whether a log is played: its position may be moved forward by hand. */
  playback: boolean;
}

/** A log that is played ten times as fast moves by 2 s between two of its states. */
const LONGEST_STEP_S = 5;

/** Whether `now` follows `before` in one and the same flight: no reset, other scenario or seek. */
export function continues(before: Instant, now: Instant): boolean {
  if (before.scenario !== now.scenario || before.playback !== now.playback) return false;
  const step = now.timeS - before.timeS;
  return step >= 0 && !(now.playback && step > LONGEST_STEP_S);
}
