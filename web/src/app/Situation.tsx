import {
  Alert,
  Button,
  Group,
  Loader,
  Paper,
  PasswordInput,
  Progress,
  Stack,
  Text,
  Title,
} from "@mantine/core";
import { CloudOff, Hourglass, TriangleAlert } from "lucide-react";
import { useConnection } from "../state/connection.ts";
import { useSilence } from "../state/silence.ts";
import { useSimulation } from "../state/simulation.ts";
import { openWindow } from "../state/windows.ts";

/** What stands between the user and a flight, if anything does: told over the scene. */
export function Situation() {
  const server = useSimulation((simulation) => simulation.server);
  const link = useConnection((connection) => connection.state);
  if (server?.token_needed === true || link === "refused") return <TokenNeeded />;
  if (server?.state === "building") return <Building />;
  if (server?.state === "failed") return <Failed />;
  if (server?.state === "lobby") return <Lobby />;
  if (link === "lost" || link === "connecting") return <NoLink />;
  return <Silent />;
}

function Building() {
  const server = useSimulation((simulation) => simulation.server);
  return (
    <Paper className="situation" shadow="lg" withBorder p="lg" role="status">
      <Group>
        <Loader size="sm" />
        <Title order={4}>Building {server?.scenario}</Title>
      </Group>
      <Text size="sm" c="dimmed" mt={6}>
        {server?.message || server?.description}
      </Text>
      <Progress value={100} animated mt="md" aria-label="Building" />
    </Paper>
  );
}

function Failed() {
  const server = useSimulation((simulation) => simulation.server);
  return (
    <Paper className="situation" shadow="lg" withBorder p="lg" role="alert">
      <Group>
        <TriangleAlert size={20} color="var(--mantine-color-red-6)" />
        <Title order={4}>{server?.scenario || "The scenario"} could not be flown</Title>
      </Group>
      <Text size="sm" my="sm" className="reason">
        {server?.message}
      </Text>
      <Button onClick={() => openWindow("scenarios")}>Choose another scenario</Button>
    </Paper>
  );
}

function Lobby() {
  const message = useSimulation(({ server }) => server?.message);
  return (
    <Paper className="situation" shadow="lg" withBorder p="lg">
      <Title order={4}>Nothing flies</Title>
      <Text size="sm" c="dimmed" my="sm">
        {message || "Choose a scenario, or drop a map of your own on this page."}
      </Text>
      <Button onClick={() => openWindow("scenarios")}>Choose a scenario</Button>
    </Paper>
  );
}

function NoLink() {
  const { reason, url, volery } = useConnection();
  return (
    <Alert
      className="banner"
      color="yellow"
      variant="filled"
      autoContrast
      icon={<CloudOff size={18} />}
      role="alert"
      title={volery ? "No connection to the simulation" : `No connection to ${url}`}
    >
      {reason || "Trying again…"} What is shown is the last that came.
    </Alert>
  );
}

function Silent() {
  const seconds = useSilence((silence) => silence.seconds);
  if (seconds === 0) return null;
  return (
    <Alert
      className="banner"
      color="yellow"
      variant="filled"
      autoContrast
      icon={<Hourglass size={18} />}
      role="alert"
      title={`Nothing has come for ${seconds} s`}
    >
      The simulation or the network stands still. What is shown is the last that came.
    </Alert>
  );
}

function TokenNeeded() {
  const reason = useConnection((connection) => connection.reason);
  return (
    <Paper className="situation" shadow="lg" withBorder p="lg">
      <form
        onSubmit={(event) => {
          event.preventDefault();
          const token = new FormData(event.currentTarget).get("token");
          const query = new URLSearchParams(location.search);
          query.set("token", String(token));
          location.search = query.toString();
        }}
      >
        <Stack gap="sm">
          <Title order={4}>This server asks for a token</Title>
          {reason !== "" && (
            <Text size="sm" c="dimmed">
              {reason}
            </Text>
          )}
          <PasswordInput label="Token" name="token" required autoComplete="current-password" />
          <Button type="submit">Enter</Button>
        </Stack>
      </form>
    </Paper>
  );
}
