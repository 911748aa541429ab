import { useEffect, useState } from "react";
import { ArrivalMeter, RateMeter } from "../../lib/rates.ts";
import { nowMs, secondsOf } from "../../lib/time.ts";
import { link } from "../../link/link.ts";
import type { sensor_msgs_CompressedImage, sensor_msgs_Image } from "../../messages/generated.ts";
import { wallAgeS } from "../../state/health.ts";
import type { CameraTopic } from "./cameraTopics.ts";
import { decode } from "./decoding.ts";

export interface CameraImageState {
  /** Width over height. */
  aspect: number;
  /** Images per second of wall time ... */
  hz: number;
  /** ... and of simulated time, by their stamps. */
  simulatedHz: number;
  /** Wall time since the image was taken, s. */
  ageS: number;
  range: [number, number] | null;
  problem: string;
}

const NOTHING: CameraImageState = {
  aspect: 4 / 3,
  hz: NaN,
  simulatedHz: NaN,
  ageS: NaN,
  range: null,
  problem: "",
};

/** Small tiles are content with fewer images. */
const LARGE_MS = 50;
const SMALL_MS = 100;
const UPDATE_MS = 500;

type ImageMessage = sensor_msgs_Image | sensor_msgs_CompressedImage;

/** Receive a camera's images while the canvas is seen, and draw them there. */
export function useCameraImage(
  camera: CameraTopic,
  canvas: HTMLCanvasElement | null,
  large: boolean,
): CameraImageState {
  const [state, setState] = useState(NOTHING);
  const { name, type } = camera;
  useEffect(() => {
    if (canvas === null) return;
    return whileSeen(canvas, () =>
      receive(name, type, canvas, large ? LARGE_MS : SMALL_MS, setState),
    );
  }, [name, type, canvas, large]);
  return state;
}

function receive(
  topic: string,
  type: string,
  canvas: HTMLCanvasElement,
  throttleMs: number,
  setState: (update: (state: CameraImageState) => CameraImageState) => void,
): () => void {
  const [meter, arrivals] = [new RateMeter(), new ArrivalMeter()];
  let [busy, stampS, arrivedMs] = [false, NaN, NaN];
  const show = async (image: ImageMessage) => {
    if (busy) return; // the newest of those that come meanwhile is soon there
    busy = true;
    try {
      const { bitmap, range } = await decode(topic, pixelsIn(image));
      draw(canvas, bitmap);
      const aspect = bitmap.width / bitmap.height;
      bitmap.close();
      setState((now) =>
        now.aspect === aspect && sameRange(now.range, range) && now.problem === ""
          ? now
          : { ...now, aspect, range, problem: "" },
      );
    } catch (error) {
      const problem = error instanceof Error ? error.message : String(error);
      setState((now) => ({ ...now, problem }));
    }
    busy = false;
  };
  const end = link.subscribe(
    topic,
    type,
    ({ message, arrivedMs: at }) => {
      const image = message as ImageMessage;
      stampS = secondsOf(image.header.stamp);
      arrivedMs = at;
      meter.add(stampS);
      arrivals.add(at / 1000);
      void show(image);
    },
    { throttleMs, depth: 1 },
  );
  const timer = setInterval(
    () =>
      setState((now) => ({
        ...now,
        hz: arrivals.hzAt(nowMs() / 1000),
        simulatedHz: meter.hz,
        ageS: ageOf(stampS, arrivedMs),
      })),
    UPDATE_MS,
  );
  return () => {
    end();
    clearInterval(timer);
  };
}

/** By the server's clock where it is known; else, and at least, since it came. */
function ageOf(stampS: number, arrivedMs: number): number {
  const [known, since] = [wallAgeS(stampS), (nowMs() - arrivedMs) / 1000];
  return Number.isNaN(known) ? since : Math.max(known, 0);
}

/** Copies of the bytes alone travel to the decoder. */
function pixelsIn(image: ImageMessage) {
  const data = Uint8Array.from(image.data as ArrayLike<number>);
  if ("format" in image) return { format: image.format, data };
  const { width, height, encoding, is_bigendian, step } = image;
  return { width, height, encoding, is_bigendian, step, data };
}

function draw(canvas: HTMLCanvasElement, bitmap: ImageBitmap): void {
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
  }
  canvas.getContext("2d")!.drawImage(bitmap, 0, 0);
}

function sameRange(a: [number, number] | null, b: [number, number] | null): boolean {
  return a === b || (a !== null && b !== null && a[0] === b[0] && a[1] === b[1]);
}

/** Runs `begin` while the element is on the screen and the page is not hidden; returns the end. */
function whileSeen(element: HTMLElement, begin: () => () => void): () => void {
  let end: (() => void) | null = null;
  let onScreen = false;
  const look = () => {
    const seen = onScreen && !document.hidden;
    if (seen && end === null) end = begin();
    else if (!seen && end !== null) {
      end();
      end = null;
    }
  };
  const observer = new IntersectionObserver(([entry]) => {
    onScreen = entry?.isIntersecting ?? false;
    look();
  });
  observer.observe(element);
  document.addEventListener("visibilitychange", look);
  return () => {
    observer.disconnect();
    document.removeEventListener("visibilitychange", look);
    end?.();
  };
}
