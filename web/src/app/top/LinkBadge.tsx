import { Badge, Tooltip } from "@mantine/core";
import { useConnection } from "../../state/connection.ts";
import { useSilence } from "../../state/silence.ts";

/** How the link is. */
export function LinkBadge() {
  const { state, reason, url } = useConnection();
  const silent = useSilence((silence) => silence.sinceMs > 0);
  const [text, color] =
    state === "open"
      ? silent
        ? ["silent", "yellow"]
        : ["live", "teal"]
      : state === "connecting"
        ? ["connecting", "yellow"]
        : [state, "red"];
  return (
    <Tooltip label={reason === "" ? url : `${url}: ${reason}`}>
      <Badge variant="dot" color={color} aria-label={`Link: ${text}`} role="status" tt="none">
        {text}
      </Badge>
    </Tooltip>
  );
}
