import { Alert, Button, FileButton, Group, Modal, Radio, Stack, Text } from "@mantine/core";
import { useEffect, useState } from "react";
import { ENDINGS, kindOf, type FileKind } from "../../lib/fileKinds.ts";
import { missingHalfOf } from "../../lib/mapPair.ts";
import { upload, uploadRecording } from "../../link/commands.ts";
import { openPanel } from "../../state/layout.ts";
import { reasonOf, showSuccess } from "../../state/notices.ts";
import { useWhyNotOpen } from "../../state/rights.ts";
import { closeWindow, offerFiles, offerScenario, useWindows } from "../../state/windows.ts";
import { SubmitRow } from "./SubmitRow.tsx";

const KINDS: { kind: FileKind; label: string; description: string }[] = [
  {
    kind: "grid_map",
    label: "Grid map",
    description:
      "A matrix of 0 and 1: CSV, PNG (dark is blocked) or MovingAI .map; or .yaml and image of ROS",
  },
  { kind: "city", label: "City", description: "Building outlines: GeoJSON" },
  { kind: "mesh", label: "Mesh", description: "Any geometry: glTF (.glb), OBJ, STL" },
  { kind: "forest", label: "Forest", description: "Tree inventory: CSV" },
  {
    kind: "scenario",
    label: "Scenario",
    description: "Complete scenario: TOML, with models and nodes included in Volery",
  },
  { kind: "log", label: "Log", description: "Recorded flight to play back: MCAP or ROS 1 bag" },
];
const PEEK_BYTES = 4096;

/** A map or a scenario of the user's own joins the scenarios, a log the recordings. */
export default function Upload() {
  const { file, image } = useWindows();
  const [kind, setKind] = useState<FileKind | null>(null);
  const [problem, setProblem] = useState("");
  const [busy, setBusy] = useState(false);
  const whyNotOpen = useWhyNotOpen();
  const half = file !== null && kind === "grid_map" ? missingHalfOf(file.name, image) : null;
  const whyNot = whyNotOpen ?? half;
  useEffect(() => {
    setProblem("");
    if (file === null) return;
    void file
      .slice(0, PEEK_BYTES)
      .text()
      .then((beginning) => setKind(kindOf(file.name, beginning)));
  }, [file]);
  const send = async () => {
    if (file === null || kind === null) return;
    setBusy(true);
    try {
      if (kind === "log") await sendLog(file);
      else offerScenario(await upload(file, kind, image));
    } catch (error) {
      setProblem(reasonOf(error));
    }
    setBusy(false);
  };
  return (
    <Modal opened onClose={closeWindow} title="Upload a map, a scenario or a log" size="md">
      <Stack gap="sm">
        <Group justify="space-between" wrap="nowrap">
          <Text truncate fw={600}>
            {file === null ? "No file" : nameOf(file, image)}
          </Text>
          <FileButton multiple accept={ENDINGS} onChange={offerFiles}>
            {(props) => (
              <Button variant="default" size="compact-md" {...props}>
                {file === null ? "Choose a file" : "Choose another file"}
              </Button>
            )}
          </FileButton>
        </Group>
        <Radio.Group
          label="File type"
          value={kind ?? ""}
          onChange={(value) => setKind(value as FileKind)}
        >
          <Stack gap={8} mt={6}>
            {KINDS.map(({ kind: value, label, description }) => (
              <Radio key={value} value={value} label={label} description={description} />
            ))}
          </Stack>
        </Radio.Group>
        {problem !== "" && (
          <Alert
            color="red"
            role="alert"
            title={
              kind === "log" ? "Cannot upload the log" : "Cannot make a scenario from the file"
            }
          >
            <span className="reason">{problem}</span>
          </Alert>
        )}
        <SubmitRow whyNot={whyNot} justify="end">
          <Button
            loading={busy}
            disabled={file === null || kind === null || whyNot !== null}
            onClick={() => void send()}
          >
            Upload
          </Button>
        </SubmitRow>
      </Stack>
    </Modal>
  );
}

async function sendLog(file: File): Promise<void> {
  showSuccess(`Uploaded ${await uploadRecording(file)}`);
  closeWindow();
  openPanel("bottom", "recordings");
}

function nameOf(file: File, image: File | null): string {
  const names = image === null ? file.name : `${file.name} + ${image.name}`;
  return `${names} (${sizeText(file.size + (image?.size ?? 0))})`;
}

function sizeText(bytes: number): string {
  return bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
