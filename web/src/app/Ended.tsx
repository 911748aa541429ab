import { Alert, Button, Group } from "@mantine/core";
import { Flag } from "lucide-react";
import { clockText, secondsOf } from "../lib/time.ts";
import { continueRun, reset, setPlaying } from "../link/commands.ts";
import { succeeds } from "../state/notices.ts";
import { useWhyNot } from "../state/rights.ts";
import { useSimulation } from "../state/simulation.ts";

/** Says that the scenario has ended, and offers what is possible from here. */
export function Ended() {
  const seconds = useSimulation(({ status }) => (status === null ? 0 : secondsOf(status.stamp)));
  const whyNot = useWhyNot();
  return (
    <Alert
      className="banner"
      color="blue"
      variant="filled"
      icon={<Flag size={18} />}
      role="status"
      title={`Scenario ended at ${clockText(seconds)}`}
    >
      <Group gap="xs">
        <Button
          size="compact-sm"
          variant="white"
          disabled={whyNot !== null}
          onClick={() => void succeeds("Reset", flyAgain())}
        >
          Reset
        </Button>
        <Button
          size="compact-sm"
          variant="white"
          disabled={whyNot !== null}
          onClick={() => void succeeds("Continue", continueRun())}
        >
          Continue
        </Button>
        {whyNot}
      </Group>
    </Alert>
  );
}

async function flyAgain(): Promise<void> {
  await reset();
  await setPlaying(true);
}
