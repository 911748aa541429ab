import { Alert } from "@mantine/core";
import { CloudOff, Hourglass } from "lucide-react";
import { useEffect, useState } from "react";
import { nowMs, timeOfDay } from "../lib/time.ts";
import { useProblem } from "../state/problem.ts";

const COUNT_MS = 500;

/** Shows a problem of the connection while it lasts. */
export function Banner() {
  const problem = useProblem();
  if (problem === null) return null;
  return (
    <Alert
      className="banner"
      color="yellow"
      variant="filled"
      autoContrast
      icon={problem.linked ? <Hourglass size={18} /> : <CloudOff size={18} />}
      role="alert"
      title={problem.what}
    >
      <Since sinceMs={problem.sinceMs} /> {problem.does}
    </Alert>
  );
}

function Since({ sinceMs }: { sinceMs: number }) {
  const [now, setNow] = useState(nowMs);
  useEffect(() => {
    const timer = setInterval(() => setNow(nowMs()), COUNT_MS);
    return () => clearInterval(timer);
  }, []);
  const seconds = Math.max(0, Math.floor((now - sinceMs) / 1000));
  return `Since ${timeOfDay(sinceMs)}, ${seconds} s ago.`;
}
