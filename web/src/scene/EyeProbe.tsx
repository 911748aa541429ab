import { useFrame } from "@react-three/fiber";
import { PerspectiveCamera, Vector3 } from "three";
import { eye } from "../state/eye.ts";

const ahead = new Vector3();

/** Reports to the map from where the scene is seen. */
export function EyeProbe() {
  useFrame(({ camera }) => {
    const [x, y, z] = camera.matrixWorld.elements.slice(12, 15) as [number, number, number];
    camera.getWorldDirection(ahead);
    eye.x = x;
    eye.y = y;
    eye.z = z;
    eye.heading = Math.atan2(ahead.y, ahead.x);
    if (camera instanceof PerspectiveCamera) {
      eye.width = 2 * Math.atan(Math.tan((camera.fov * Math.PI) / 360) * camera.aspect);
    }
  });
  return null;
}
