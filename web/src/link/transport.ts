import { AbstractTransport, type RosbridgeMessage } from "roslib";

/** roslib's connection to the server over the browser's WebSocket; knows how large the last frame was. */
export class MeteredTransport extends AbstractTransport {
  bytes = 0;
  messages = 0;
  lastFrameBytes = 0;

  constructor(private readonly socket: WebSocket) {
    super();
    socket.binaryType = "arraybuffer";
    socket.onopen = (event) => this.emit("open", event);
    socket.onclose = (event) => this.emit("close", event);
    socket.onerror = (event) => this.emit("error", event);
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      const data = event.data;
      this.lastFrameBytes = typeof data === "string" ? data.length : data.byteLength;
      this.bytes += this.lastFrameBytes;
      this.messages += 1;
      this.handleRawMessage(data);
    };
  }

  send(message: RosbridgeMessage): void {
    this.socket.send(JSON.stringify(message, longNumbers));
  }

  close(): void {
    this.socket.close();
  }

  isConnecting(): boolean {
    return this.socket.readyState === WebSocket.CONNECTING;
  }

  isOpen(): boolean {
    return this.socket.readyState === WebSocket.OPEN;
  }

  isClosing(): boolean {
    return this.socket.readyState === WebSocket.CLOSING;
  }

  isClosed(): boolean {
    return this.socket.readyState === WebSocket.CLOSED;
  }
}

function longNumbers(_key: string, value: unknown): unknown {
  return typeof value === "bigint" ? Number(value) : value;
}
