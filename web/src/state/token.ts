// The token that a link carries. The server answers it with a cookie, by which all further requests
// pass, so it leaves the address bar, the history and whatever is bookmarked or shared from there.

/** Whether the page was opened with a token in its address. */
export let hadToken = false;

/** Takes the token out of the page's address. */
export function hideToken(address: Location, history: History): void {
  const query = new URLSearchParams(address.search);
  if (!query.has("token")) return;
  hadToken = true;
  query.delete("token");
  const rest = query.toString();
  history.replaceState(
    history.state,
    "",
    `${address.pathname}${rest === "" ? "" : `?${rest}`}${address.hash}`,
  );
}

/**
 * Shows a token to the server; returns whether it is one of its own, and sets the cookie. The page
 * itself is asked for, because the cookie holds for the folder of what was asked for.
 */
export async function showToken(token: string): Promise<boolean> {
  const query = new URLSearchParams({ token });
  await fetch(`./?${query}`, { cache: "no-store" });
  const answer = await fetch("./api/status", { cache: "no-store" });
  return answer.ok && !((await answer.json()) as { token_needed: boolean }).token_needed;
}
