import { Canvas } from "@react-three/fiber";
import { Views } from "../views/Views.tsx";
import { Sky } from "./Sky.tsx";
import { Uavs } from "./Uavs.tsx";
import { World } from "./World.tsx";

/** Inside, coordinates are those of the map: ENU, metres. */
export const ENU_ROTATION: [number, number, number] = [-Math.PI / 2, 0, 0];

/** The picture: the world, what flies in it, and from where it is seen. */
export function Scene() {
  return (
    <Canvas
      shadows
      dpr={[1, 2]}
      camera={{ fov: 55, near: 0.05, far: 4000, position: [20, 14, 20] }}
      gl={{ antialias: true, powerPreference: "high-performance" }}
    >
      <Sky />
      <World />
      <group rotation={ENU_ROTATION}>
        <Uavs />
      </group>
      <Views />
    </Canvas>
  );
}
