import { useFrame } from "@react-three/fiber";
import { useRef } from "react";
import type { Group } from "three";
import { link } from "../link/link.ts";
import { POSE } from "../link/protocol.ts";
import { baseFrame, useVehicles } from "../state/vehicles.ts";

/** All UAVs where they are now. */
export function Uavs() {
  const names = useVehicles(({ list }) => list.map(({ name }) => name).join(" "));
  return names.split(" ").map((name) => <Uav key={name} name={name} />);
}

function Uav({ name }: { name: string }) {
  const group = useRef<Group>(null);
  useFrame(() => {
    const { frames } = link;
    const row = frames.row(baseFrame(name));
    if (group.current === null) return;
    group.current.visible = row >= 0;
    if (row < 0) return;
    const [x, y, z, qx, qy, qz, qw] = frames.now.subarray(row * POSE, (row + 1) * POSE);
    group.current.position.set(x!, y!, z!);
    group.current.quaternion.set(qx!, qy!, qz!, qw!);
  });
  return (
    <group ref={group}>
      <mesh castShadow>
        <boxGeometry args={[0.5, 0.5, 0.12]} />
        <meshStandardMaterial color="#e8543f" />
      </mesh>
    </group>
  );
}
