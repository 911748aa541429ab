import { Alert } from "@mantine/core";
import { Unplug } from "lucide-react";
import { useEffect, useState } from "react";
import classes from "./Banner.module.css";
import { nowMs } from "../lib/time.ts";
import { useTrouble, type Trouble } from "../state/trouble.ts";

const COUNT_MS = 500;

/** Says at once when what is shown is no longer live, and goes away by itself. */
export function Banner() {
  const trouble = useTrouble();
  if (trouble === null) return null;
  return (
    <Alert
      className={classes.banner}
      color={trouble.grave ? "red" : "yellow"}
      variant="filled"
      icon={<Unplug size={18} />}
      title={trouble.what}
      role="alert"
      p="xs"
    >
      <Since trouble={trouble} />
    </Alert>
  );
}

function Since({ trouble }: { trouble: Trouble }) {
  const [now, setNow] = useState(nowMs);
  useEffect(() => {
    const timer = setInterval(() => setNow(nowMs()), COUNT_MS);
    return () => clearInterval(timer);
  }, []);
  const seconds = Math.max(0, Math.floor((now - trouble.sinceMs) / 1000));
  const clock = new Date(trouble.sinceMs).toLocaleTimeString();
  return `Since ${clock} (${seconds} s). ${trouble.does}`;
}
