// Short notifications: every failed request is shown with the server's reason.

import { notifications } from "@mantine/notifications";

const FAILURE_MS = 7000;
const SUCCESS_MS = 3000;

export function showFailure(what: string, reason: string): void {
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

export function showSuccess(message: string): void {
  notifications.show({ id: message, message, autoClose: SUCCESS_MS, withBorder: true });
}

/** Waits for a command; shows a failure and returns null. */
export async function attempt<T>(what: string, asked: Promise<T>): Promise<T | null> {
  try {
    return await asked;
  } catch (error) {
    showFailure(what, reasonOf(error));
    return null;
  }
}

/** Returns whether a command succeeded; shows a failure. */
export async function succeeds(what: string, asked: Promise<unknown>): Promise<boolean> {
  try {
    await asked;
    return true;
  } catch (error) {
    showFailure(what, reasonOf(error));
    return false;
  }
}

export function reasonOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
