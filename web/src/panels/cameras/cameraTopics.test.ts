import { expect, it } from "vitest";
import { cameraTopics, colourFirst } from "./cameraTopics.ts";

const IMAGE = "sensor_msgs/msg/Image";
const COMPRESSED = "sensor_msgs/msg/CompressedImage";

it("each camera is shown once, compressed where it can be", () => {
  const topics = [
    { name: "/uav1/front/image_raw", type: IMAGE },
    { name: "/uav1/front/image_raw/compressed", type: COMPRESSED },
    { name: "/uav1/front/depth", type: IMAGE },
    { name: "/uav1/front/depth/compressedDepth", type: COMPRESSED },
    { name: "/uav1/front/labels/instance", type: IMAGE },
    { name: "/uav1/down/image_raw", type: IMAGE },
    { name: "/uav1/imu", type: "sensor_msgs/msg/Imu" },
  ];
  expect(cameraTopics(topics).map(({ name, title }) => [name, title])).toEqual([
    ["/uav1/front/image_raw/compressed", "uav1 front"],
    ["/uav1/front/depth", "uav1 front depth"],
    ["/uav1/front/labels/instance", "uav1 front labels instance"],
    ["/uav1/down/image_raw", "uav1 down"],
  ]);
});

it("colours come before depth and labels, otherwise in the given order", () => {
  const names = ["/uav1/down/depth", "/uav1/down/image_raw", "/uav1/front/labels/instance"];
  names.push("/uav1/front/image_raw");
  const cameras = cameraTopics(names.map((name) => ({ name, type: IMAGE })));
  expect(colourFirst(cameras).map(({ title }) => title)).toEqual([
    "uav1 down",
    "uav1 front",
    "uav1 down depth",
    "uav1 front labels instance",
  ]);
});
