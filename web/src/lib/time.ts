/** A ROS time in seconds; both generations' spellings. */
export function secondsOf(stamp: {
  sec?: number;
  nanosec?: number;
  secs?: number;
  nsecs?: number;
}): number {
  return (stamp.sec ?? stamp.secs ?? 0) + (stamp.nanosec ?? stamp.nsecs ?? 0) * 1e-9;
}

/** `83.4` as `1:23.4`. */
export function clockText(seconds: number): string {
  const sign = seconds < 0 ? "-" : "";
  const tenths = Math.floor(Math.abs(seconds) * 10);
  const minutes = Math.floor(tenths / 600);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  return `${sign}${minutes}:${rest}`;
}

/** Wall time as the worker measures it, ms. */
export function nowMs(): number {
  return performance.timeOrigin + performance.now();
}

/** A short span: `0.4 s`, `12 s`, `3 min`, `2 h`. */
export function spanText(seconds: number): string {
  if (!Number.isFinite(seconds)) return "–";
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  if (seconds < 7200) return `${(seconds / 60).toFixed(0)} min`;
  return `${(seconds / 3600).toFixed(0)} h`;
}

/** `16.5` as `16:30`. */
export function hourText(hour: number): string {
  const minutes = Math.round(hour * 60) % 1440;
  return `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}`;
}

/** Wall time as a clock of 24 hours shows it, whatever the browser's language: `16:05:09`. */
export function timeOfDay(ms: number): string {
  const time = new Date(ms);
  return [time.getHours(), time.getMinutes(), time.getSeconds()]
    .map((part) => String(part).padStart(2, "0"))
    .join(":");
}
