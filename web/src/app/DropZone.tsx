import { Text } from "@mantine/core";
import { Upload } from "lucide-react";
import { useEffect, useState } from "react";
import { UPLOAD_HINT } from "../lib/fileKinds.ts";
import { useConnection } from "../state/connection.ts";
import { offerFiles } from "../state/windows.ts";

/** A file that is dropped anywhere on the page is offered for an upload. */
export function DropZone() {
  const volery = useConnection((connection) => connection.volery);
  const [over, setOver] = useState(false);
  useEffect(() => {
    if (!volery) return;
    const hasFile = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    const drag = (event: DragEvent) => {
      if (!hasFile(event)) return;
      event.preventDefault();
      setOver(true);
    };
    const leave = (event: DragEvent) => {
      if (event.relatedTarget === null) setOver(false);
    };
    const drop = (event: DragEvent) => {
      if (!hasFile(event)) return;
      event.preventDefault();
      setOver(false);
      offerFiles([...(event.dataTransfer?.files ?? [])]);
    };
    window.addEventListener("dragover", drag);
    window.addEventListener("dragleave", leave);
    window.addEventListener("drop", drop);
    return () => {
      window.removeEventListener("dragover", drag);
      window.removeEventListener("dragleave", leave);
      window.removeEventListener("drop", drop);
    };
  }, [volery]);
  if (!over) return null;
  return (
    <div className="drop-zone">
      <Upload size={48} />
      <Text size="lg" fw={600}>
        Drop a map or a scenario to fly, or a log to play back
      </Text>
      <Text c="dimmed">{UPLOAD_HINT}</Text>
    </div>
  );
}
