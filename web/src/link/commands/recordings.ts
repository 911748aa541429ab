// Logs: record, list, fetch, bring, open, play.

import { order } from "./requests.ts";
import { read } from "./http.ts";

export interface Recording {
  name: string;
  bytes: number;
  /** null: not known. */
  seconds: number | null;
  kind: string;
}

const LONGEST_START_S = 60;

/** Record the whole graph below the folder of recordings; where the log is. */
export async function startRecording(path: string): Promise<string> {
  const type = "volery_interfaces/srv/StartRecording";
  const answer = await order("/volery/start_recording", type, { path });
  return answer.path;
}

/** End the recording; how many messages it holds. */
export async function stopRecording(): Promise<{ path: string; messages: number }> {
  const { path, messages } = await order(
    "/volery/stop_recording",
    "volery_interfaces/srv/StopRecording",
    {},
    LONGEST_START_S,
  );
  return { path, messages: Number(messages) };
}

export async function recordings(): Promise<Recording[]> {
  return (await read(await fetch("./api/recordings", { cache: "no-store" }))) as Recording[];
}

export function recordingUrl(name: string): string {
  return `./api/recordings/${encodeURIComponent(name)}`;
}

/** Bring a log to the server; its name there. */
export async function uploadRecording(file: File): Promise<string> {
  const query = new URLSearchParams({ name: file.name });
  const answer = await fetch(`./api/recordings?${query}`, { method: "POST", body: file });
  return ((await read(answer)) as { name: string }).name;
}

/** Play a log instead of the present world; the page reconnects meanwhile. */
export async function playRecording(name: string): Promise<void> {
  const type = "volery_interfaces/srv/PlayRecording";
  await order("/volery/play_recording", type, { name }, LONGEST_START_S);
}

/** Go to a time of the log that is being played, s. */
export async function seek(time: number): Promise<void> {
  await order("/volery/player/seek", "volery_interfaces/srv/Seek", { time });
}

/** Return from a log to the simulation that was flown before. */
export async function closeRecording(): Promise<void> {
  await order("/volery/player/close", "std_srvs/srv/Trigger", {}, LONGEST_START_S);
}

export async function setLoop(data: boolean): Promise<void> {
  await order("/volery/player/set_loop", "std_srvs/srv/SetBool", { data });
}
