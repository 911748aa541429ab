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
