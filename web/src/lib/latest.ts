/**
 * Sends the newest of many wishes: not more often than `everyMs`, one at a time, the last one
 * always. What a slider or a dragged handle asks for goes through one of these.
 */
export class Latest<T> {
  private next: { value: T } | null = null;
  private running = false;

  constructor(
    private readonly send: (value: T) => Promise<void>,
    private readonly everyMs: number,
  ) {}

  offer(value: T): void {
    this.next = { value };
    if (!this.running) void this.run();
  }

  private async run(): Promise<void> {
    this.running = true;
    while (this.next !== null) {
      const { value } = this.next;
      this.next = null;
      const pause = new Promise((resolve) => setTimeout(resolve, this.everyMs));
      await this.send(value).catch(() => undefined); // reported by `send` itself
      await pause;
    }
    this.running = false;
  }
}
