import { useCallback } from "react";
import { pathsIn } from "../../lib/fieldPath.ts";
import { fieldsOf, numericPaths } from "../../lib/typeDefinitions.ts";
import { messageDefinitions, nextMessage } from "../../link/commands.ts";
import { useRequest } from "../shared/useRequest.ts";

const NO_PATHS: string[] = [];

/** A text, which may hold JSON: what is in it is seen by its messages. */
const TEXT = /^std_msgs\/(msg\/)?String$/;
const WAIT_MS = 5000;

/** Paths of the numbers of a topic; `reason` says why there are none. */
export function usePaths(topic: string, type: string): { paths: string[]; reason: string } {
  const describe = useCallback(async () => {
    if (type === "") return NO_PATHS;
    if (TEXT.test(type)) return pathsIn(await nextMessage(topic, type, WAIT_MS));
    return [...new Set(numericPaths(fieldsOf(await messageDefinitions(type))))];
  }, [topic, type]);
  const { value: paths, reason } = useRequest(describe, NO_PATHS);
  return { paths, reason };
}
