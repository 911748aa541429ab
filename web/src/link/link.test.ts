import { expect, it, vi } from "vitest";

vi.stubGlobal(
  "Worker",
  class {
    postMessage = () => undefined;
  },
);
const { Link } = await import("./link.ts");

it("a message that one listener cannot read reaches the others, and is reported once", () => {
  const warned = vi.spyOn(console, "warn").mockImplementation(() => undefined);
  const worker = { postMessage: () => undefined } as unknown as Worker;
  const link = new Link(worker);
  const received: unknown[] = [];
  link.subscribe("/scan", "sensor_msgs/msg/LaserScan", () => {
    throw new Error("no ranges");
  });
  link.subscribe("/scan", "sensor_msgs/msg/LaserScan", ({ message }) => received.push(message));
  for (const message of [1, 2]) {
    const data = { kind: "message", id: 1, message, bytes: 1, arrivedMs: 1 };
    worker.onmessage!({ data } as MessageEvent);
  }
  expect(received).toEqual([1, 2]);
  expect(warned).toHaveBeenCalledTimes(1);
});
