import { useCallback } from "react";
import { fieldsOf, numericPaths } from "../../lib/typeDefinitions.ts";
import { messageDefinitions } from "../../link/commands.ts";
import { useRequest } from "../shared/useRequest.ts";

const NO_PATHS: string[] = [];

/** Paths of a type's numbers; `reason` says why there are none. */
export function usePaths(type: string): { paths: string[]; reason: string } {
  const describe = useCallback(
    async () =>
      type === "" ? NO_PATHS : [...new Set(numericPaths(fieldsOf(await messageDefinitions(type))))],
    [type],
  );
  const { value: paths, reason } = useRequest(describe, NO_PATHS);
  return { paths, reason };
}
