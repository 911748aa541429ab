import {
  ActionIcon,
  Badge,
  Button,
  FileButton,
  Group,
  ScrollArea,
  Table,
  Text,
} from "@mantine/core";
import { TextInput } from "@mantine/core";
import { Circle, Download, Play, Square, Upload } from "lucide-react";
import { useState } from "react";
import { counted } from "../../lib/counted.ts";
import { clockText } from "../../lib/time.ts";
import { bytesText } from "../../lib/traffic.ts";
import {
  playRecording,
  recordings,
  recordingUrl,
  startRecording,
  stopRecording,
  uploadRecording,
  type Recording,
} from "../../link/commands.ts";
import { attempt, showSuccess } from "../../state/notices.ts";
import { useWhyNot, useWhyNotOpen } from "../../state/rights.ts";
import { useSimulation } from "../../state/simulation.ts";
import { Reason } from "../shared/Reason.tsx";
import { useRequest } from "../shared/useRequest.ts";

const NONE: Recording[] = [];
const ASK_MS = 2000;

/** Record, and see what was recorded again. */
export default function Recordings() {
  const { value: list, reason, again } = useRequest(recordings, NONE, ASK_MS);
  const whyNot = useWhyNot();
  const whyNotOpen = useWhyNotOpen();

  const open = async (name: string) => {
    await attempt("Playback failed", playRecording(name));
  };
  const send = async (file: File | null) => {
    if (file === null) return;
    const name = await attempt("Upload failed", uploadRecording(file));
    if (name !== null) showSuccess(`Uploaded ${name}`);
    again();
  };

  return (
    <ScrollArea h="100%" type="auto">
      <Group gap="xs" px="sm" pb={6}>
        <Recorder onChange={again} whyNot={whyNot} />
        <FileButton accept=".mcap,.bag" onChange={(file) => void send(file)}>
          {(props) => (
            <Button
              {...props}
              size="compact-sm"
              variant="default"
              leftSection={<Upload size={14} />}
              disabled={whyNotOpen !== null}
            >
              Upload a log
            </Button>
          )}
        </FileButton>
        <Reason>{reason}</Reason>
      </Group>
      {list.length === 0 ? (
        <Text size="sm" c="dimmed" px="sm">
          No recordings.
        </Text>
      ) : (
        <Table verticalSpacing={2} fz="sm" aria-label="Recordings" highlightOnHover>
          <Table.Thead>
            <Table.Tr>
              <Table.Th>Name</Table.Th>
              <Table.Th>Duration</Table.Th>
              <Table.Th>Size</Table.Th>
              <Table.Th />
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {list.map((recording) => (
              <Table.Tr key={recording.name}>
                <Table.Td ff="monospace">{recording.name}</Table.Td>
                <Table.Td>
                  {recording.seconds === null ? "–" : clockText(recording.seconds)}
                </Table.Td>
                <Table.Td>{bytesText(recording.bytes)}</Table.Td>
                <Table.Td>
                  <Group gap={4} wrap="nowrap" justify="end">
                    <Button
                      size="compact-xs"
                      variant="light"
                      leftSection={<Play size={13} />}
                      aria-label={`Play ${recording.name}`}
                      disabled={whyNotOpen !== null}
                      onClick={() => void open(recording.name)}
                    >
                      Play
                    </Button>
                    <ActionIcon
                      component="a"
                      size="sm"
                      variant="subtle"
                      href={recordingUrl(recording.name)}
                      download={recording.name}
                      aria-label={`Download ${recording.name}`}
                    >
                      <Download size={14} />
                    </ActionIcon>
                  </Group>
                </Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      )}
    </ScrollArea>
  );
}

interface RecorderProps {
  onChange: () => void;
  whyNot: string | null;
}

/** Begin and end a recording. */
function Recorder({ onChange, whyNot }: RecorderProps) {
  const running = useSimulation(({ status }) => status?.recording ?? "");
  const [name, setName] = useState("");

  const start = async () => {
    const path = name.trim() === "" ? usualName() : name.trim();
    const answer = await attempt("Recording failed", startRecording(withSuffix(path)));
    if (answer !== null) setName("");
    onChange();
  };
  const stop = async () => {
    const answer = await attempt("Recording failed", stopRecording());
    if (answer !== null) showSuccess(`Recorded ${counted(answer.messages, "message")}`);
    onChange();
  };

  if (running !== "") {
    return (
      <Group gap="xs">
        <Badge color="red" variant="dot" tt="none">
          {running}
        </Badge>
        <Button
          size="compact-sm"
          color="red"
          leftSection={<Square size={13} />}
          disabled={whyNot !== null}
          onClick={() => void stop()}
        >
          Stop
        </Button>
      </Group>
    );
  }
  return (
    <Group gap="xs">
      <TextInput
        size="xs"
        w={220}
        aria-label="Name of the recording"
        placeholder="flight.mcap, or .bag for ROS 1"
        value={name}
        onChange={(event) => setName(event.currentTarget.value)}
      />
      <Button
        size="compact-sm"
        color="red"
        variant="light"
        leftSection={<Circle size={13} fill="currentColor" />}
        disabled={whyNot !== null}
        onClick={() => void start()}
      >
        Record
      </Button>
    </Group>
  );
}

function withSuffix(name: string): string {
  return /\.(mcap|bag)$/.test(name) ? name : `${name}.mcap`;
}

/** `flight_2026-02-03_14-05-09`: no file is ever replaced. */
function usualName(): string {
  return `flight_${new Date().toISOString().slice(0, 19).replace("T", "_").replaceAll(":", "-")}`;
}
