import { useEffect, useMemo, useState } from "react";
import { Latest } from "../../lib/latest.ts";
import { getWeather, setWeather, type Weather } from "../../link/commands.ts";
import { link } from "../../link/link.ts";
import { reasonOf, succeeds } from "../../state/notices.ts";
import { useConnection } from "../../state/connection.ts";

const CALM: Weather = {
  wind: { x: 0, y: 0, z: 0 },
  w20: 0,
  rain: 0,
  snow: 0,
  fog_visibility: 0,
  dust_visibility: 0,
  hour_of_day: 0,
};

/** Ten changes a second are as many as a hand on a slider can distinguish. */
const SEND_MS = 100;

/** The weather that the simulation has confirmed, and how to change it. */
export function useWeather() {
  const [weather, setConfirmed] = useState(CALM);
  const [problem, setProblem] = useState("");
  const open = useConnection(({ state }) => state === "open");
  useEffect(() => {
    if (!open) return;
    getWeather()
      .then((confirmed) => {
        setConfirmed(confirmed);
        setProblem("");
      })
      .catch((error: unknown) => setProblem(`Weather is unavailable: ${reasonOf(error)}`));
    return link.subscribe("/weather", "volery_interfaces/msg/Weather", ({ message }) =>
      setConfirmed(message),
    );
  }, [open]);
  const change = useMemo(() => {
    let waiting: Partial<Weather> = {};
    const sender = new Latest<void>(async () => {
      const changes = waiting;
      waiting = {};
      await succeeds("Weather", setWeather(changes));
    }, SEND_MS);
    return (changes: Partial<Weather>) => {
      waiting = { ...waiting, ...changes };
      sender.offer();
    };
  }, []);
  return { weather, change, problem };
}
