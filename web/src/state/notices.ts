// Short notifications: every failure of what the page asks for is told, with the server's reason.

import { notifications } from "@mantine/notifications";

const FAILURE_MS = 7000;
const SUCCESS_MS = 3000;

export function tellFailure(what: string, reason: string): void {
  notifications.show({
    // The same refusal many times in a row, as of a dragged slider, is one notification.
    id: `${what}: ${reason}`,
    title: what,
    message: reason,
    color: "red",
    autoClose: FAILURE_MS,
    withBorder: true,
  });
}

export function tellSuccess(message: string): void {
  notifications.show({ id: message, message, autoClose: SUCCESS_MS, withBorder: true });
}

/** Wait for a command; a failure is told and answers null. */
export async function attempt<T>(what: string, asked: Promise<T>): Promise<T | null> {
  try {
    return await asked;
  } catch (error) {
    tellFailure(what, reasonOf(error));
    return null;
  }
}

/** Whether it was done; a failure is told. */
export async function succeeds(what: string, asked: Promise<unknown>): Promise<boolean> {
  try {
    await asked;
    return true;
  } catch (error) {
    tellFailure(what, reasonOf(error));
    return false;
  }
}

export function reasonOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
