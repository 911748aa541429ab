import {
  DataTexture,
  Group,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  Quaternion,
  SRGBColorSpace,
  Vector3,
} from "three";
import { pixelsOf } from "../../lib/rasterImage.ts";
import { link } from "../../link/link.ts";
import type { sensor_msgs_CameraInfo, sensor_msgs_Image } from "../../messages/generated.ts";
import { useVehicles } from "../../state/vehicles.ts";
import { useView } from "../../state/view.ts";
import { SegmentLines } from "../lines/SegmentLines.ts";
import { toMap } from "../stage/mapFrame.ts";
import type { Moment, Part } from "../stage/part.ts";
import { followTopics, isKnown, type Follower } from "../stage/topics.ts";
import { SELECTED } from "../uavs/colours.ts";
import { cameras, type CameraModel } from "./cameras.ts";
import { bytesOf } from "./pointClouds.ts";

const INFO = "sensor_msgs/msg/CameraInfo";
const MAX_CAMERAS = 24;
const LENGTH_M = 1.2;
const EDGES = 8;
const IMAGE_MS = 300;
const PALE = [0.75, 0.8, 0.9] as const;

/** What cameras see: a pyramid each, and at its end the image where that is wished. */
export class Frusta implements Part {
  readonly object = new Group();
  private readonly lines = new SegmentLines(MAX_CAMERAS * EDGES);
  private readonly follower: Follower;
  private readonly images = new Map<string, CameraImage>();

  constructor() {
    this.object.add(this.lines.object);
    this.follower = followTopics(
      [INFO],
      (topic, type) =>
        link.subscribe(
          topic,
          type,
          ({ message }) => note(topic, message as sensor_msgs_CameraInfo),
          {
            throttleMs: 1000,
          },
        ),
      (topic) => cameras.delete(topic),
    );
  }

  update(moment: Moment): void {
    const { show, name } = useView.getState();
    this.object.visible = show.frusta || show.pictures;
    const { selected } = useVehicles.getState();
    let count = 0;
    const seen = new Set<string>();
    for (const camera of cameras.values()) {
      const own = camera.frame.startsWith(`${selected}/`);
      if (own && name === "onboard") continue; // from within, the pyramid is not drawn
      if (count + EDGES > MAX_CAMERAS * EDGES || !this.object.visible) break;
      const pose = link.frames.pose(camera.frame);
      if (pose === null) continue;
      const corners = cornersOf(camera).map(([x, y]) =>
        toMap(pose, x * LENGTH_M, y * LENGTH_M, LENGTH_M),
      );
      const apex = toMap(pose, 0, 0, 0);
      corners.forEach((corner, i) => {
        const colour = own ? SELECTED : PALE;
        const next = corners[(i + 1) % 4]!;
        if (!show.frusta) return;
        this.lines.put(count++, ...apex, ...corner, 1.2, colour, 0.7);
        this.lines.put(count++, ...corner, ...next, 1.2, colour, 0.7);
      });
      if (own && show.pictures) {
        seen.add(camera.topic);
        this.imageOf(camera).place(camera, pose);
      }
    }
    this.forget(seen);
    this.lines.count = count;
    this.lines.send(0, count);
    this.lines.update(moment);
  }

  dispose(): void {
    this.follower.end();
    this.forget(new Set());
    this.lines.dispose();
  }

  private imageOf(camera: CameraModel): CameraImage {
    let image = this.images.get(camera.topic);
    if (image === undefined) {
      image = new CameraImage(camera.topic);
      this.images.set(camera.topic, image);
      this.object.add(image.mesh);
    }
    return image;
  }

  private forget(kept: ReadonlySet<string>): void {
    for (const [topic, image] of this.images) {
      if (kept.has(topic)) continue;
      this.object.remove(image.mesh);
      image.dispose();
      this.images.delete(topic);
    }
  }
}

function note(topic: string, { header, width, height, k }: sensor_msgs_CameraInfo): void {
  const [fx, fy, cx, cy] = [k[0]!, k[4]!, k[2]!, k[5]!];
  if (!(fx > 0 && fy > 0 && width > 0 && height > 0)) return;
  const frame = header.frame_id.replace(/^\//, "");
  cameras.set(topic, { topic, frame, width, height, fx, fy, cx, cy });
}

/** Corners of what is seen at a distance of 1, in the optical frame. */
function cornersOf({ width, height, fx, fy, cx, cy }: CameraModel): [number, number][] {
  const [left, right] = [-cx / fx, (width - cx) / fx];
  const [top, bottom] = [-cy / fy, (height - cy) / fy];
  return [
    [left, top],
    [right, top],
    [right, bottom],
    [left, bottom],
  ];
}

/** The newest image of one camera. */
class CameraImage {
  readonly mesh: Mesh<PlaneGeometry, MeshBasicMaterial>;
  private readonly end: () => void;

  constructor(info: string) {
    this.mesh = new Mesh(
      new PlaneGeometry(1, 1),
      new MeshBasicMaterial({ side: 2, toneMapped: false, fog: false }),
    );
    this.mesh.visible = false;
    const base = info.replace(/camera_info$/, "");
    const topic = ["image_raw", "image", "depth", "image_rect"].map((n) => base + n).find(isKnown);
    this.end =
      topic === undefined
        ? () => undefined
        : link.subscribe(
            topic,
            "sensor_msgs/msg/Image",
            ({ message }) => this.take(topic, message),
            {
              throttleMs: IMAGE_MS,
            },
          );
  }

  place({ width, height, fx, fy, cx, cy }: CameraModel, pose: Parameters<typeof toMap>[0]): void {
    const middle = [(0.5 * width - cx) / fx, (0.5 * height - cy) / fy] as const;
    const at = toMap(pose, middle[0] * LENGTH_M, middle[1] * LENGTH_M, LENGTH_M);
    this.mesh.position.set(...at);
    this.mesh.quaternion.set(pose[3], pose[4], pose[5], pose[6]).multiply(UPRIGHT);
    this.mesh.scale.copy(SCALE.set((width / fx) * LENGTH_M, (height / fy) * LENGTH_M, 1));
  }

  private take(topic: string, message: sensor_msgs_Image): void {
    let pixels;
    try {
      pixels = pixelsOf({ ...message, data: bytesOf(message.data) }, topic);
    } catch {
      return; // an encoding that cannot be shown: the pyramid alone is
    }
    const { width, height, rgba } = pixels;
    this.mesh.material.map?.dispose();
    const texture = new DataTexture(new Uint8Array(rgba.buffer), width, height);
    texture.colorSpace = SRGBColorSpace;
    texture.flipY = true;
    texture.needsUpdate = true;
    const first = this.mesh.material.map === null;
    this.mesh.material.map = texture;
    if (first) this.mesh.material.needsUpdate = true;
    this.mesh.visible = true;
  }

  dispose(): void {
    this.end();
    this.mesh.material.map?.dispose();
    this.mesh.material.dispose();
    this.mesh.geometry.dispose();
  }
}

/** Optical frames have y down. */
const UPRIGHT = new Quaternion(1, 0, 0, 0);
const SCALE = new Vector3();
