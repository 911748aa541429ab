/** One exchange with the server: asked, its clock, answered; all in ms. */
export interface Exchange {
  sentMs: number;
  serverMs: number;
  receivedMs: number;
}

/**
 * By how much the page's clock is ahead of the server's, as NTP estimates it: of the last
 * exchanges the quickest, whose delays there and back cannot have differed by much (RFC 5905).
 */
export class ClockOffset {
  private readonly exchanges: Exchange[] = [];

  constructor(private readonly maxExchanges = 8) {}

  add(exchange: Exchange): void {
    this.exchanges.push(exchange);
    if (this.exchanges.length > this.maxExchanges) this.exchanges.shift();
  }

  /** ms; NaN before there was an exchange. */
  get ms(): number {
    const best = this.best();
    return best === null ? NaN : (best.sentMs + best.receivedMs) / 2 - best.serverMs;
  }

  /** The offset is wrong by at most this, ms. */
  get errorMs(): number {
    const best = this.best();
    return best === null ? NaN : (best.receivedMs - best.sentMs) / 2;
  }

  clear(): void {
    this.exchanges.length = 0;
  }

  private best(): Exchange | null {
    let best: Exchange | null = null;
    for (const exchange of this.exchanges) {
      if (best === null || took(exchange) < took(best)) best = exchange;
    }
    return best;
  }
}

function took({ sentMs, receivedMs }: Exchange): number {
  return receivedMs - sentMs;
}
