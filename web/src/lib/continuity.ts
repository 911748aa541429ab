/** What a view of a run is about; it continues another one where nothing has jumped. */
export interface Instant {
  /** Name of the scenario; null where it is not known. */
  scenario: string | null;
  /** Simulated time, or the position in a log, s. */
  timeS: number;
  /** Whether a log is played: its position may be moved forward by hand. */
  playback: boolean;
  /** First and last time of the log, s. */
  log?: readonly [number, number];
}

/** A log that is played ten times as fast moves by 2 s between two of its states. */
export const LONGEST_STEP_S = 5;

/** Whether both are of the same scenario, live, or of the same log. */
export function isSameRun(before: Instant, now: Instant): boolean {
  return (
    before.scenario === now.scenario &&
    before.playback === now.playback &&
    before.log?.[0] === now.log?.[0] &&
    before.log?.[1] === now.log?.[1]
  );
}

/** Whether `now` follows `before` in one and the same flight: no reset, other scenario or seek. */
export function continues(before: Instant, now: Instant): boolean {
  if (!isSameRun(before, now)) return false;
  const step = now.timeS - before.timeS;
  return step >= 0 && !(now.playback && step > LONGEST_STEP_S);
}
