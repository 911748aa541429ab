// The connection to rosbridge. It lives in a worker, so that neither decoding nor a flood of
// messages can hold up the drawing. It reconnects by itself and subscribes again.

import { Ros, Service, Topic } from "roslib";
import type { geometry_msgs_TransformStamped } from "../messages/generated.ts";
import { readTransforms, type Transforms } from "../lib/cdrTransforms.ts";
import { FrameTree, transformsOf } from "./frameTree.ts";
import type { FromWorker, ToWorker, Wish } from "./protocol.ts";
import { Streams } from "./streams.ts";
import { MeteredTransport } from "./transport.ts";

const FIRST_RETRY_MS = 250;
const LONGEST_RETRY_MS = 500;
const TRAFFIC_MS = 500;
const POLICY_VIOLATION = 1008;

/** What the server's own encoding of a message looks like. */
interface RawMessage {
  bytes: Uint8Array;
}

interface TransformMessage {
  transforms: geometry_msgs_TransformStamped[];
}

let url = "";
let ros: Ros | null = null;
let transport: MeteredTransport | null = null;
let retryMs = FIRST_RETRY_MS;
let follow: { throttleMs: number; truth: boolean } | null = null;
const tree = new FrameTree();
const wishes = new Map<number, Wish>();
const topics = new Map<number, Topic>();
const outgoing = new Map<string, Topic>();
const waiting = new Map<number, (reason: string) => void>();
const streams = new Streams(publish, nowMs);

self.onmessage = (event: MessageEvent<ToWorker>) => {
  const order = event.data;
  switch (order.kind) {
    case "connect":
      url = order.url;
      void connect();
      break;
    case "subscribe":
      wishes.set(order.id, order);
      if (ros?.isConnected) subscribe(order.id, order);
      break;
    case "unsubscribe":
      wishes.delete(order.id);
      topics.get(order.id)?.unsubscribe();
      topics.delete(order.id);
      break;
    case "call":
      call(order);
      break;
    case "publish":
      publish(order.topic, order.type, order.message);
      break;
    case "stream":
      if (ros?.isConnected) streams.renew(order);
      break;
    case "endStream":
      streams.end(order.topic);
      break;
    case "unadvertise":
      outgoing.get(order.topic)?.unadvertise();
      outgoing.delete(order.topic);
      break;
    case "followFrames":
      follow = order;
      if (ros?.isConnected) followFrames();
      break;
  }
};

setInterval(() => {
  if (transport === null) return;
  const { bytes, messages } = transport;
  transport.bytes = transport.messages = 0;
  post({ kind: "traffic", bytes, messages, arrivedMs: nowMs() });
}, TRAFFIC_MS);

async function connect(): Promise<void> {
  ros?.close();
  post({ kind: "state", state: "connecting", reason: "", url });
  const mine = new Ros({
    transportFactory: (address) => {
      transport = new MeteredTransport(new WebSocket(address));
      transport.on("message", heed);
      return Promise.resolve(transport);
    },
  });
  ros = mine;
  mine.on("connection", () => {
    retryMs = FIRST_RETRY_MS;
    tree.forget();
    post({ kind: "state", state: "open", reason: "", url });
    for (const [id, wish] of wishes) subscribe(id, wish);
    followFrames();
  });
  mine.on("error", () => undefined); // a close follows, and says more
  mine.on("close", (event) => {
    if (mine !== ros) return;
    lose(event as CloseEvent);
  });
  await mine.connect(url).catch(() => undefined);
}

/** What is refused without an answer of its own, such as a message, comes as a status. */
function heed(message: object): void {
  const { op, level, msg } = message as { op?: string; level?: string; msg?: string };
  if (op === "status" && level === "error") post({ kind: "complaint", text: msg ?? "" });
}

function lose(event: CloseEvent): void {
  transport = null;
  topics.clear();
  outgoing.clear();
  streams.drop();
  frameTopics.length = 0;
  for (const fail of waiting.values()) fail("connection lost");
  waiting.clear();
  const refused = event.code === POLICY_VIOLATION;
  const reason = event.reason || (refused ? "the server refused the connection" : "");
  post({ kind: "state", state: refused ? "refused" : "lost", reason, url });
  setTimeout(() => void connect(), retryMs);
  retryMs = Math.min(LONGEST_RETRY_MS, retryMs * 2);
}

function subscribe(id: number, wish: Wish): void {
  const topic = make(wish);
  topics.set(id, topic);
  topic.subscribe((message) =>
    post({ kind: "message", id, message, bytes: frameBytes(), arrivedMs: nowMs() }),
  );
}

function make(wish: Wish, compression = "cbor"): Topic {
  return new Topic({
    ros: ros!,
    name: wish.topic,
    messageType: wish.type,
    compression,
    throttle_rate: wish.throttleMs,
    queue_length: wish.depth,
    reconnect_on_close: false, // subscribed again with the next connection, see `connect`
  });
}

function call(order: Extract<ToWorker, { kind: "call" }>): void {
  const { id, service, type, request, timeoutS } = order;
  const done = (answer: FromWorker) => {
    if (!waiting.delete(id)) return;
    clearTimeout(timer);
    post(answer);
  };
  const fail = (reason: string) => done({ kind: "answer", id, ok: false, reason });
  const timer = setTimeout(() => fail(`${service} timed out`), timeoutS * 1000);
  waiting.set(id, fail);
  if (!ros?.isConnected) {
    fail("not connected");
    return;
  }
  new Service({ ros, name: service, serviceType: type }).callService(
    request,
    (value) => done({ kind: "answer", id, ok: true, value }),
    (reason) => fail(typeof reason === "string" ? reason : JSON.stringify(reason)),
  );
}

function publish(name: string, type: string, message: unknown): void {
  if (!ros?.isConnected) return;
  let topic = outgoing.get(name);
  if (topic === undefined) {
    topic = new Topic({ ros, name, messageType: type, reconnect_on_close: false });
    outgoing.set(name, topic);
  }
  topic.publish(message);
}

// --------------------------------------------------------------------------------- transforms

const frameTopics: Topic[] = [];
let sentVersion = -1;
/** Whether the simulation publishes ground truth, which wins over estimates. */
let truthReceived = false;
let names: string[] = [];

function followFrames(): void {
  for (const topic of frameTopics.splice(0)) topic.unsubscribe();
  if (follow === null) return;
  const type = "tf2_msgs/msg/TFMessage";
  const { throttleMs, truth } = follow;
  const listen = (topic: string, throttle: number, take: (transforms: Transforms) => void) => {
    // Several publish on /tf, each a part of the tree: none of them may be throttled away.
    const wish = { topic, type, throttleMs: throttle, depth: throttle > 0 ? 1 : 100 };
    // A simulation sends CDR; the own encoding of a robot may be that of ROS 1.
    const made = truth ? make(wish, "cbor-raw") : make(wish);
    made.subscribe((message) =>
      take(
        truth
          ? readTransforms((message as RawMessage).bytes)
          : transformsOf((message as TransformMessage).transforms),
      ),
    );
    frameTopics.push(made);
  };
  listen("/tf_static", 0, (transforms) => {
    tree.fix(transforms);
    postPoses(transforms);
  });
  listen("/tf", 0, (transforms) => {
    tree.move(transforms);
    if (!truthReceived) postPoses(transforms);
  });
  truthReceived = false; // a recording may lack it
  if (!truth) return;
  listen("/ground_truth/tf", throttleMs, (transforms) => {
    truthReceived = true;
    tree.moveTruly(transforms);
    postPoses(transforms);
  });
}

function postPoses({ stampS }: Transforms): void {
  if (tree.version !== sentVersion) {
    sentVersion = tree.version;
    const frames = tree.names();
    names = frames.names;
    post({ kind: "frames", ...frames });
  }
  if (Number.isNaN(stampS)) return;
  const poses = tree.rows(names);
  self.postMessage({ kind: "poses", poses, stampS, arrivedMs: nowMs() } satisfies FromWorker, {
    transfer: [poses.buffer],
  });
}

// -------------------------------------------------------------------------------------- small

function post(message: FromWorker): void {
  self.postMessage(message);
}

function frameBytes(): number {
  return transport?.lastFrameBytes ?? 0;
}

function nowMs(): number {
  return performance.timeOrigin + performance.now();
}
