/** Light of the day. */
export function Sky() {
  return (
    <>
      <color attach="background" args={["#a9c8e6"]} />
      <hemisphereLight args={["#dcebff", "#6b6a55", 1.2]} />
      <directionalLight position={[80, 120, 40]} intensity={2.2} castShadow />
    </>
  );
}
