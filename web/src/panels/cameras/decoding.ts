import type { Decoded, Order } from "./decoder.ts";

/** An image that is ready to be drawn; `bitmap` must be closed. */
export interface Ready {
  bitmap: ImageBitmap;
  range: [number, number] | null;
}

type Waiting = (decoded: Decoded) => void;

let worker: Worker | null = null;
let next = 1;
const waiting = new Map<number, Waiting>();

/** Decode one image; rejects with the reason where it cannot be shown. */
export function decode(topic: string, image: Order["image"]): Promise<Ready> {
  worker ??= start();
  const id = next++;
  worker.postMessage({ id, topic, image } satisfies Order);
  return new Promise((resolve, reject) => {
    waiting.set(id, (decoded) => {
      if (decoded.ok) resolve(decoded);
      else reject(new Error(decoded.reason));
    });
  });
}

function start(): Worker {
  const made = new Worker(new URL("./decoder.ts", import.meta.url), { type: "module" });
  made.onmessage = ({ data }: MessageEvent<Decoded>) => {
    waiting.get(data.id)?.(data);
    waiting.delete(data.id);
  };
  return made;
}
