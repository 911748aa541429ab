// Commands that are published repeatedly. The page renews each many times a second; where its thread
// is held up, by a slow frame or a large message, they go on from here for as long as the lease
// lasts. Then the UAV is commanded to rest: a page that hangs must not leave a UAV flying.

export interface StreamOrder {
  topic: string;
  type: string;
  message: unknown;
  /** What ends the stream. */
  rest: unknown;
}

/** How often a command is repeated while its renewal is late, ms. */
const PERIOD_MS = 50;
/** Renewals come every 50 ms; so much later they are late. */
const LATE_MS = 90;
/** How long after the last renewal a command still counts. */
export const LEASE_MS = 1000;

interface Stream {
  order: StreamOrder;
  renewedMs: number;
  timer: ReturnType<typeof setTimeout>;
}

export class Streams {
  private readonly streams = new Map<string, Stream>();

  constructor(
    private readonly publish: (topic: string, type: string, message: unknown) => void,
    private readonly nowMs: () => number,
  ) {}

  /** Publish it now, and again while it is not renewed. */
  renew(order: StreamOrder): void {
    this.forget(order.topic);
    this.publish(order.topic, order.type, order.message);
    const timer = setTimeout(() => this.repeat(order.topic), LATE_MS);
    this.streams.set(order.topic, { order, renewedMs: this.nowMs(), timer });
  }

  /** Publish its rest, once. */
  end(topic: string): void {
    const stream = this.streams.get(topic);
    if (stream === undefined) return;
    this.forget(topic);
    this.publish(topic, stream.order.type, stream.order.rest);
  }

  /** Without a message, as when the connection is lost: the UAV comes to rest by itself. */
  drop(): void {
    for (const topic of [...this.streams.keys()]) this.forget(topic);
  }

  private repeat(topic: string): void {
    const stream = this.streams.get(topic)!;
    if (this.nowMs() - stream.renewedMs >= LEASE_MS) return this.end(topic);
    this.publish(topic, stream.order.type, stream.order.message);
    stream.timer = setTimeout(() => this.repeat(topic), PERIOD_MS);
  }

  private forget(topic: string): void {
    clearTimeout(this.streams.get(topic)?.timer);
    this.streams.delete(topic);
  }
}
