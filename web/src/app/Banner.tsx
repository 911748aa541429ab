import { Alert } from "@mantine/core";
import { CloudOff, Hourglass } from "lucide-react";
import { useEffect, useState } from "react";
import { nowMs } from "../lib/time.ts";
import { useTrouble } from "../state/trouble.ts";

const COUNT_MS = 500;

/** Says at once when what is shown is no longer live, and goes away by itself. */
export function Banner() {
  const trouble = useTrouble();
  if (trouble === null) return null;
  return (
    <Alert
      className="banner"
      color="yellow"
      variant="filled"
      autoContrast
      icon={trouble.linked ? <Hourglass size={18} /> : <CloudOff size={18} />}
      role="alert"
      title={trouble.what}
    >
      <Since sinceMs={trouble.sinceMs} /> {trouble.does}
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
  return `Since ${new Date(sinceMs).toLocaleTimeString()}, ${seconds} s ago.`;
}
