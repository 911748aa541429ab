import { expect, test, vi } from "vitest";
import { hideToken, showToken } from "./token.ts";

const address = (search: string) =>
  ({ pathname: "/user/anna/", search, hash: "#view=map" }) as Location;

test("a token leaves the address, all else stays", () => {
  const replaceState = vi.fn();
  const history = { state: { a: 1 }, replaceState } as unknown as History;
  hideToken(address("?operator=Anna&token=se%20cret&token=again"), history);
  expect(replaceState).toHaveBeenCalledWith({ a: 1 }, "", "/user/anna/?operator=Anna#view=map");
  hideToken(address("?token=x"), history);
  expect(replaceState).toHaveBeenLastCalledWith({ a: 1 }, "", "/user/anna/#view=map");
});

test("an address without a token stays as it is", () => {
  const replaceState = vi.fn();
  hideToken(address("?operator=Anna"), { replaceState } as unknown as History);
  expect(replaceState).not.toHaveBeenCalled();
});

test("a token is shown to the server, whatever its characters", async () => {
  const status = { token_needed: false };
  const asked = vi.fn((...urls: string[]) =>
    Promise.resolve({ ok: urls[0] !== "", json: () => Promise.resolve(status) }),
  );
  vi.stubGlobal("fetch", asked);
  expect(await showToken("ä & b")).toBe(true);
  expect(asked.mock.calls[0]![0]).toBe("./?token=%C3%A4+%26+b");
  status.token_needed = true;
  expect(await showToken("wrong")).toBe(false);
  vi.unstubAllGlobals();
});
