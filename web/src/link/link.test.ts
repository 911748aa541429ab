import { expect, it, vi } from "vitest";

vi.stubGlobal(
  "Worker",
  class {
    postMessage = () => undefined;
  },
);
const { Link } = await import("./link.ts");

it("a message that one listener cannot read reaches the others, and is told once", () => {
  const warned = vi.spyOn(console, "warn").mockImplementation(() => undefined);
  const worker = { postMessage: () => undefined } as unknown as Worker;
  const link = new Link(worker);
  const heard: unknown[] = [];
  link.subscribe("/scan", "sensor_msgs/msg/LaserScan", () => {
    throw new Error("no ranges");
  });
  link.subscribe("/scan", "sensor_msgs/msg/LaserScan", ({ message }) => heard.push(message));
  for (const message of [1, 2]) {
    const told = { kind: "message", id: 1, message, bytes: 1, arrivedMs: 1 };
    worker.onmessage!({ data: told } as MessageEvent);
  }
  expect(heard).toEqual([1, 2]);
  expect(warned).toHaveBeenCalledTimes(1);
});
