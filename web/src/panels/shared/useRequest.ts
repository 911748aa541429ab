import { useCallback, useEffect, useState } from "react";
import { useConnection } from "../../state/connection.ts";

export interface Requested<T> {
  value: T;
  /** Why the request failed; empty: it succeeded. */
  reason: string;
  again: () => void;
}

/** Returns the response of a request, sent with each connection, and every `everyMs` if that is not 0. */
export function useRequest<T>(ask: () => Promise<T>, first: T, everyMs = 0): Requested<T> {
  const [value, setValue] = useState(first);
  const [reason, setReason] = useState("");
  const open = useConnection(({ state }) => state === "open");
  const again = useCallback(() => {
    ask().then(
      (answer) => {
        setValue(() => answer);
        setReason("");
      },
      (error: unknown) => setReason(error instanceof Error ? error.message : String(error)),
    );
  }, [ask]);
  useEffect(() => {
    if (!open) return undefined;
    again();
    if (everyMs === 0) return undefined;
    const timer = setInterval(again, everyMs);
    return () => clearInterval(timer);
  }, [again, open, everyMs]);
  return { value, reason, again };
}
