import { Canvas, useFrame, useThree } from "@react-three/fiber";
import { useEffect, useRef } from "react";
import { NeutralToneMapping, Object3D, PCFShadowMap, type PerspectiveCamera } from "three";
import { ViewMenu } from "../views/ViewMenu.tsx";
import { BoxSelection } from "./BoxSelection.tsx";
import { DragHandle } from "./DragHandle.tsx";
import { EyeProbe } from "./EyeProbe.tsx";
import { GroundPicker } from "./GroundPicker.tsx";
import { isSoftware } from "./stage/quality.ts";
import { Stage } from "./stage/Stage.ts";

// Coordinates of the scene are those of the map: ENU, metres.
Object3D.DEFAULT_UP.set(0, 0, 1);

/** The scene: the world, what flies in it, and from where it is seen. */
export function Scene() {
  return (
    <>
      <Canvas
        shadows={{ type: PCFShadowMap }}
        camera={{ fov: 55, near: 0.05, far: 6000, position: [-9, -5, 5] }}
        gl={{
          antialias: !isSoftware(),
          powerPreference: "high-performance",
          toneMapping: NeutralToneMapping,
        }}
        tabIndex={0}
        aria-label="Scene"
      >
        <Cameras />
        <BoxSelection />
        <DragHandle />
        <EyeProbe />
        <GroundPicker />
      </Canvas>
      <ViewMenu />
    </>
  );
}

/** Runs the stage; it draws by itself, once a frame. */
function Cameras() {
  const { scene, camera, gl, setDpr } = useThree();
  const stage = useRef<Stage | null>(null);
  useEffect(() => {
    const made = new Stage(scene, camera as PerspectiveCamera, gl, setDpr);
    stage.current = made;
    return () => {
      stage.current = null;
      made.dispose();
    };
  }, [scene, camera, gl, setDpr]);
  // A priority above 0 leaves the drawing to us.
  useFrame(({ size }) => stage.current?.frame(size.width, size.height), 1);
  return null;
}
