import {
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
import { TriangleAlert } from "lucide-react";
import { useState } from "react";
import { useConnection } from "../state/connection.ts";
import { useSimulation } from "../state/simulation.ts";
import { situationOf } from "../state/situation.ts";
import { hadToken, showToken } from "../state/token.ts";
import { openWindow } from "../state/windows.ts";
import { Banner } from "./Banner.tsx";
import { Ended } from "./Ended.tsx";

/** Shows over the scene why nothing flies, or why the data is not live. */
export function Situation() {
  const server = useSimulation((simulation) => simulation.server);
  const reachable = useSimulation((simulation) => simulation.reachable);
  const ended = useSimulation(({ status }) => status?.ended ?? false);
  const link = useConnection((connection) => connection.state);
  switch (situationOf(server, reachable, link, ended)) {
    case "token_needed":
      return <TokenNeeded />;
    case "building":
      return <Building />;
    case "failed":
      return <Failed />;
    case "no_world":
      return <NoWorld />;
    case "ended":
      return <Ended />;
    case "flying":
      return <Banner />;
  }
}

function Building() {
  const server = useSimulation((simulation) => simulation.server);
  return (
    <Paper className="situation" shadow="lg" withBorder p="lg" role="status">
      <Group>
        <Loader size="sm" />
        <Title order={4}>Building {server?.title || server?.scenario}</Title>
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
        <Title order={4}>Cannot start {server?.title || server?.scenario || "the scenario"}</Title>
      </Group>
      <Text size="sm" my="sm" className="reason">
        {server?.message}
      </Text>
      <Button onClick={() => openWindow("scenarios")}>Choose another scenario</Button>
    </Paper>
  );
}

function NoWorld() {
  const message = useSimulation(({ server }) => server?.message);
  return (
    <Paper className="situation" shadow="lg" withBorder p="lg">
      <Title order={4}>No scenario is running</Title>
      <Text size="sm" c="dimmed" my="sm">
        {message || "Choose a scenario, or drop a map file on this page."}
      </Text>
      <Button onClick={() => openWindow("scenarios")}>Choose a scenario</Button>
    </Paper>
  );
}

const WRONG_TOKEN = "The server does not accept this token";

function TokenNeeded() {
  const reason = useConnection((connection) => connection.reason);
  const [refused, setRefused] = useState("");
  const wrong = hadToken ? "The server does not accept the token in the address" : "";
  return (
    <Paper className="situation" shadow="lg" withBorder p="lg">
      <form
        onSubmit={(event) => {
          event.preventDefault();
          const token = String(new FormData(event.currentTarget).get("token"));
          showToken(token).then(
            (isRight) => (isRight ? location.reload() : setRefused(WRONG_TOKEN)),
            () => setRefused("The server does not respond"),
          );
        }}
      >
        <Stack gap="sm">
          <Title order={4}>This server requires a token</Title>
          {reason !== "" && (
            <Text size="sm" c="dimmed">
              {reason}
            </Text>
          )}
          <PasswordInput
            label="Token"
            name="token"
            required
            autoComplete="current-password"
            error={refused || wrong}
          />
          <Button type="submit">Connect</Button>
        </Stack>
      </form>
    </Paper>
  );
}
