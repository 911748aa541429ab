import { describe, expect, it } from "vitest";
import { cameraOf, cameraText } from "./cameraText.ts";

const POSE = {
  x: 12.34,
  y: -5,
  z: 100.5,
  yaw: 1.2345,
  pitch: -0.3,
  distance: 14.25,
  follows: false,
};

describe("camera in the address", () => {
  it("comes back as it was written", () => {
    expect(cameraOf(cameraText(POSE))).toEqual(POSE);
    expect(cameraOf(cameraText({ ...POSE, follows: true }))).toEqual({ ...POSE, follows: true });
  });

  it("is none where the text is not one", () => {
    for (const text of [null, "", "1_2_3", "1_2_3_4_5_x", "1_2__4_5_6", "f", "1_2_3_4_5_6_7"])
      expect(cameraOf(text)).toBeNull();
  });
});
