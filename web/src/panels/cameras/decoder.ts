// Decodes images off the main thread: compressed ones by the browser, raw ones by us.

import { pixelsOf, type RawImage } from "../../lib/rasterImage.ts";

export interface Order {
  id: number;
  topic: string;
  image: RawImage | { format: string; data: Uint8Array<ArrayBuffer> };
}

export type Decoded =
  | { id: number; ok: true; bitmap: ImageBitmap; range: [number, number] | null }
  | { id: number; ok: false; reason: string };

self.onmessage = async (event: MessageEvent<Order>) => {
  const { id, topic, image } = event.data;
  try {
    const { bitmap, range } = "format" in image ? await ofFile(image) : await ofRaw(image, topic);
    const decoded: Decoded = { id, ok: true, bitmap, range };
    self.postMessage(decoded, { transfer: [bitmap] });
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    self.postMessage({ id, ok: false, reason } satisfies Decoded);
  }
};

async function ofFile({ format, data }: { format: string; data: Uint8Array<ArrayBuffer> }) {
  const type = format.includes("png") ? "image/png" : "image/jpeg";
  return { bitmap: await createImageBitmap(new Blob([data], { type })), range: null };
}

async function ofRaw(image: RawImage, topic: string) {
  const { rgba, width, height, range } = pixelsOf(image, topic);
  return { bitmap: await createImageBitmap(new ImageData(rgba, width, height)), range };
}
