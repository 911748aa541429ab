import { Text } from "@mantine/core";
import { useState } from "react";
import { ratesText } from "../../lib/rates.ts";
import { spanText } from "../../lib/time.ts";
import { showCamera, useLayout, type Tile } from "../../state/layout.ts";
import { FloatingTile } from "../FloatingTile.tsx";
import type { CameraTopic } from "./cameraTopics.ts";
import { useCameraImage } from "./useCameraImage.ts";

const LARGE_PX = 360;
/** Tiles side by side leave one another room in narrow scenes. */
const MAX_FRACTION = 0.25;

/** What one camera sees, how old it is and how often it comes. */
export function CameraTile({ camera, usual }: { camera: CameraTopic; usual: Tile }) {
  const [canvas, setCanvas] = useState<HTMLCanvasElement | null>(null);
  const width = useLayout((layout) => layout.tiles[camera.name]?.width ?? usual.width);
  const { aspect, hz, simulatedHz, ageS, range, problem } = useCameraImage(
    camera,
    canvas,
    width >= LARGE_PX,
  );
  return (
    <FloatingTile
      name={camera.name}
      title={camera.title}
      usual={usual}
      maxFraction={MAX_FRACTION}
      aspect={aspect}
      onClose={() => showCamera(camera.name, false)}
    >
      <canvas ref={setCanvas} className="camera-image" role="img" aria-label={camera.title} />
      {problem !== "" && (
        <Text size="xs" c="red" className="camera-problem" role="alert">
          {problem}
        </Text>
      )}
      <Text size="xs" className="camera-label" aria-label={`${camera.title}: rate and age`}>
        {ratesText(hz, simulatedHz)} · {spanText(ageS)} old
      </Text>
      {range !== null && <Legend range={range} />}
    </FloatingTile>
  );
}

/** What the colours of depth mean. */
function Legend({ range: [near, far] }: { range: [number, number] }) {
  return (
    <div className="camera-legend" aria-label={`${near.toFixed(1)} m to ${far.toFixed(1)} m`}>
      <span>{near.toFixed(1)} m</span>
      <span className="turbo" aria-hidden />
      <span>{far.toFixed(1)} m</span>
    </div>
  );
}
