import { Badge, Tooltip } from "@mantine/core";
import { useConnection } from "../../state/connection.ts";
import { usePlayer } from "../../state/player.ts";
import { useSilence } from "../../state/silence.ts";

/** How the link is. */
export function LinkBadge() {
  const { state, reason, url } = useConnection();
  const playback = usePlayer(({ player }) => player !== null);
  const silent = useSilence((silence) => silence.sinceMs > 0);
  const [text, color] =
    state === "open"
      ? silent
        ? ["silent", "yellow"]
        : playback
          ? ["playback", "grape"]
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
