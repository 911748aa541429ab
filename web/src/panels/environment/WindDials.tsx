import { Button, Group } from "@mantine/core";
import { CloudSun, Wind } from "lucide-react";
import { useState } from "react";
import { blowGust, clearWeather } from "../../link/commands.ts";
import { attempt } from "../../state/notices.ts";
import { Section } from "../inspector/Section.tsx";
import { Dial } from "./Dial.tsx";
import { FieldDials } from "./FieldDials.tsx";
import type { useWeather } from "./useWeather.ts";
import { TURBULENCE } from "./weatherFields.ts";
import { compass, fromDegrees, toDegrees } from "./wind.ts";

const GUST_RISE_S = 0.5;
const GUST_S = 3;

type WindProps = Pick<ReturnType<typeof useWeather>, "weather" | "change"> & { disabled: boolean };

/** Speed and direction of the wind, turbulence and gusts. */
export function WindDials({ weather, change, disabled }: WindProps) {
  const blowing = Math.hypot(weather.wind.x, weather.wind.y);
  // A direction outlives a calm, in which the wind itself has none.
  const [lastDirection, setLastDirection] = useState(0);
  const direction = blowing > 0.01 ? toDegrees(weather.wind) : lastDirection;
  const blow = (speed: number, degrees: number) => {
    setLastDirection(degrees);
    change({ wind: fromDegrees(speed, degrees) });
  };
  const gust = () => {
    const speed = Math.max(4, blowing);
    void attempt("Gust", blowGust(fromDegrees(speed, direction), GUST_RISE_S, GUST_S));
  };
  return (
    <Section title="Wind">
      <Dial
        name="Wind"
        min={0}
        max={20}
        step={0.5}
        value={blowing}
        text={(speed) => `${speed.toFixed(1)} m/s`}
        disabled={disabled}
        onChange={(speed) => blow(speed, direction)}
      />
      <Dial
        name="Wind from"
        min={0}
        max={355}
        step={5}
        value={direction}
        text={(degrees) => `${degrees.toFixed(0)}°, ${compass(degrees)}`}
        disabled={disabled}
        onChange={(degrees) => blow(blowing, degrees)}
      />
      <FieldDials fields={TURBULENCE} values={weather} disabled={disabled} change={change} />
      <Group gap="xs">
        <Button
          size="compact-sm"
          variant="light"
          leftSection={<Wind size={15} />}
          disabled={disabled}
          onClick={gust}
        >
          Add a gust
        </Button>
        <Button
          size="compact-sm"
          variant="subtle"
          leftSection={<CloudSun size={15} />}
          disabled={disabled}
          onClick={() => void attempt("Weather", clearWeather())}
        >
          Clear weather
        </Button>
      </Group>
    </Section>
  );
}
