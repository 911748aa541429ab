import { useThree } from "@react-three/fiber";
import { useEffect } from "react";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

/** From where the scene is seen. */
export function Views() {
  const { camera, gl } = useThree();
  useEffect(() => {
    const controls = new OrbitControls(camera, gl.domElement);
    return () => controls.dispose();
  }, [camera, gl]);
  return null;
}
