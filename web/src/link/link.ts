import type { Messages, Services } from "../messages/generated.ts";
import { Frames } from "./frames.ts";
import type { FromWorker, LinkState, ToWorker } from "./protocol.ts";

export interface Received<T> {
  message: T;
  /** Size on the wire. */
  bytes: number;
  arrivedMs: number;
}

type Listener = (received: Received<never>) => void;

interface Subscription {
  id: number;
  key: string;
  listeners: Set<Listener>;
  last: Received<never> | null;
  /** Whether a listener could not read a message; reported once. */
  unreadable: boolean;
}

export interface SubscribeOptions {
  /** Minimum time between two messages, ms. */
  throttleMs?: number;
  /** How many wait at the server for a slow page. */
  depth?: number;
}

/** What the page has of a rosbridge: topics, services, frames. All in one worker. */
export class Link {
  readonly frames = new Frames();
  state: LinkState = "connecting";
  reason = "";
  url = "";
  /** When anything last arrived, as `nowMs()`. */
  receivedMs = 0;
  bytesPerS = 0;
  messagesPerS = 0;

  /** Called with what the server refuses without an answer of its own: messages. */
  onComplaint: (text: string) => void = () => undefined;

  private readonly worker: Worker;
  private nextId = 1;
  private readonly byKey = new Map<string, Subscription>();
  private readonly byId = new Map<number, Subscription>();
  private readonly answers = new Map<number, (answer: FromWorker & { kind: "answer" }) => void>();
  private readonly stateListeners = new Set<() => void>();
  private trafficMs = 0;

  constructor(worker?: Worker) {
    this.worker = worker ?? new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    this.worker.onmessage = (event: MessageEvent<FromWorker>) => this.take(event.data);
  }

  connect(url: string): void {
    this.post({ kind: "connect", url });
  }

  /** Follow the transforms of the graph; with `truth` those of the simulation itself. */
  followFrames(throttleMs: number, truth: boolean): void {
    this.post({ kind: "followFrames", throttleMs, truth });
  }

  /** Call `listener` when `state` changes; returns how to end that. */
  watch(listener: () => void): () => void {
    this.stateListeners.add(listener);
    return () => this.stateListeners.delete(listener);
  }

  /** Receive a topic; equal wishes share one subscription. Returns how to end it. */
  subscribe<N extends keyof Messages>(
    topic: string,
    type: N,
    listener: (received: Received<Messages[N]>) => void,
    options?: SubscribeOptions,
  ): () => void;
  subscribe(
    topic: string,
    type: string,
    listener: (received: Received<unknown>) => void,
    options?: SubscribeOptions,
  ): () => void;
  subscribe(
    topic: string,
    type: string,
    listener: (received: Received<never>) => void,
    { throttleMs = 0, depth = 1 }: SubscribeOptions = {},
  ): () => void {
    const key = `${topic} ${type} ${throttleMs} ${depth}`;
    let subscription = this.byKey.get(key);
    if (subscription === undefined) {
      subscription = {
        id: this.nextId++,
        key,
        listeners: new Set(),
        last: null,
        unreadable: false,
      };
      this.byKey.set(key, subscription);
      this.byId.set(subscription.id, subscription);
      this.post({ kind: "subscribe", id: subscription.id, topic, type, throttleMs, depth });
    } else if (subscription.last !== null) {
      listener(subscription.last); // what is latched was sent to the first listener only
    }
    const mine = subscription;
    mine.listeners.add(listener);
    return () => {
      mine.listeners.delete(listener);
      if (mine.listeners.size > 0 || this.byKey.get(key) !== mine) return;
      this.byKey.delete(key);
      this.byId.delete(mine.id);
      this.post({ kind: "unsubscribe", id: mine.id });
    };
  }

  /** Call a service; rejects with the server's reason. */
  call<N extends keyof Services>(
    service: string,
    type: N,
    request: DeepPartial<Services[N]["request"]>,
    timeoutS?: number,
  ): Promise<Services[N]["response"]>;
  call(service: string, type: string, request: unknown, timeoutS?: number): Promise<unknown>;
  call(service: string, type: string, request: unknown, timeoutS = 20): Promise<unknown> {
    const id = this.nextId++;
    return new Promise((resolve, reject) => {
      this.answers.set(id, (answer) => {
        if (answer.ok) resolve(answer.value);
        else reject(new Error(answer.reason));
      });
      this.post({ kind: "call", id, service, type, request, timeoutS });
    });
  }

  publish<N extends keyof Messages>(
    topic: string,
    type: N,
    message: DeepPartial<Messages[N]>,
  ): void;
  publish(topic: string, type: string, message: unknown): void;
  publish(topic: string, type: string, message: unknown): void {
    this.post({ kind: "publish", topic, type, message });
  }

  /** Publish now, and again until it is renewed, ended, or too old (`streams.ts`): then `rest`. */
  stream<N extends keyof Messages>(
    topic: string,
    type: N,
    message: DeepPartial<Messages[N]>,
    rest: DeepPartial<Messages[N]>,
  ): void {
    this.post({ kind: "stream", topic, type, message, rest });
  }

  endStream(topic: string): void {
    this.post({ kind: "endStream", topic });
  }

  unadvertise(topic: string): void {
    this.post({ kind: "unadvertise", topic });
  }

  private post(order: ToWorker): void {
    this.worker.postMessage(order);
  }

  private take(message: FromWorker): void {
    switch (message.kind) {
      case "message": {
        this.receivedMs = message.arrivedMs;
        const subscription = this.byId.get(message.id);
        if (subscription === undefined) return;
        const received = message as unknown as Received<never>;
        subscription.last = received;
        for (const listener of subscription.listeners) hand(received, listener, subscription);
        break;
      }
      case "poses":
        this.receivedMs = message.arrivedMs;
        this.frames.move(message);
        break;
      case "frames":
        this.frames.rename(message);
        break;
      case "answer": {
        const done = this.answers.get(message.id);
        this.answers.delete(message.id);
        done?.(message);
        break;
      }
      case "complaint":
        this.onComplaint(message.text);
        break;
      case "traffic":
        this.measure(message.bytes, message.messages, message.arrivedMs);
        break;
      case "state":
        this.state = message.state;
        this.reason = message.reason;
        this.url = message.url;
        if (message.state !== "open") for (const s of this.byId.values()) s.last = null;
        for (const listener of this.stateListeners) listener();
        break;
    }
  }

  private measure(bytes: number, messages: number, arrivedMs: number): void {
    const seconds = (arrivedMs - this.trafficMs) / 1000;
    this.trafficMs = arrivedMs;
    this.bytesPerS = bytes / seconds;
    this.messagesPerS = messages / seconds;
  }
}

/** A message of which the server fills in what is left out. */
export type DeepPartial<T> = T extends (infer U)[]
  ? DeepPartial<U>[]
  : T extends ArrayBufferView
    ? T
    : T extends object
      ? { [K in keyof T]?: DeepPartial<T[K]> }
      : T;

/** A message that one listener cannot read, as when its sender left the type, still reaches the others. */
function hand(received: Received<never>, listener: Listener, subscription: Subscription): void {
  try {
    listener(received);
  } catch (error) {
    if (!subscription.unreadable) console.warn(`unreadable: ${subscription.key}`, error);
    subscription.unreadable = true;
  }
}

/** The page's one link. */
export const link = new Link();
