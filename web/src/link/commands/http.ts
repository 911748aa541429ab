// Answers of the server's own pages.

import { RefusedError } from "./requests.ts";

/** JSON of an answer; a refusal's reason is its `error`. */
export async function read(answer: Response): Promise<unknown> {
  const body = (await answer.json().catch(() => null)) as { error?: string } | null;
  if (answer.ok && body !== null) return body;
  throw new RefusedError(body?.error ?? `the server returned status ${answer.status}`);
}
