import { create } from "zustand";
import { link } from "../link/link.ts";
import type { LinkState } from "../link/protocol.ts";

/** How the page's link is. */
interface Connection {
  state: LinkState;
  reason: string;
  url: string;
  /** Whether the page shows a Volery server; false: any other rosbridge. */
  volery: boolean;
}

export const useConnection = create<Connection>(() => ({
  state: "connecting",
  reason: "",
  url: "",
  volery: true,
}));

/**
 * Connect to what the page's address names: `?ros=ws://robot:9090`, else the own server.
 * `operator` is what the user wants to be called there; empty: as the server likes.
 */
export function connectAsAddressed(address: Location, operator: string): void {
  const query = new URLSearchParams(address.search);
  const robot = query.get("ros");
  const own = new URL("./rosbridge", address.href);
  own.protocol = own.protocol === "https:" ? "wss:" : "ws:";
  own.search = own.hash = "";
  if (operator !== "") own.searchParams.set("operator", operator);
  useConnection.setState({ volery: robot === null });
  link.watch(() => {
    const { state, reason, url } = link;
    useConnection.setState({ state, reason, url });
  });
  link.followFrames(33, robot === null);
  link.connect(robot ?? own.href);
}
