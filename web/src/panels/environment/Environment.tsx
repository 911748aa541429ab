import { Alert, Button, Group, ScrollArea, Stack } from "@mantine/core";
import { CloudSun, Wind } from "lucide-react";
import { useState } from "react";
import { blowGust, clearWeather } from "../../link/commands.ts";
import { hourText } from "../../lib/time.ts";
import { attempt } from "../../state/notices.ts";
import { useWhyNot } from "../../state/rights.ts";
import { Section } from "../inspector/Section.tsx";
import { Blocks } from "./Blocks.tsx";
import { Dial } from "./Dial.tsx";
import { positionOfVisibility, visibilityOf, visibilityText } from "./visibility.ts";
import { Trees } from "./Trees.tsx";
import { useWeather } from "./useWeather.ts";
import { fromDegrees, toDegrees } from "./wind.ts";

const GUST_RISE_S = 0.5;
const GUST_S = 3;

/** Wind, weather, hour of day, and what stands in the world. */
export default function Environment() {
  const { weather, change, trouble } = useWeather();
  const whyNot = useWhyNot();
  return (
    <ScrollArea h="100%" type="auto">
      <Stack gap="sm" px="sm" pb="md">
        {whyNot !== null && <Alert p="xs">{whyNot}</Alert>}
        {trouble !== "" && (
          <Alert color="yellow" p="xs">
            {trouble}
          </Alert>
        )}
        <Air weather={weather} change={change} disabled={whyNot !== null} />
        <Section title="Light">
          <Dial
            name="Hour of day"
            min={0.25}
            max={24}
            step={0.25}
            value={weather.hour_of_day}
            text={(hour) => (hour === 0 ? "as the scenario says" : hourText(hour))}
            disabled={whyNot !== null}
            onChange={(hour_of_day) => change({ hour_of_day })}
          />
        </Section>
        <Blocks />
        <Trees />
      </Stack>
    </ScrollArea>
  );
}

type AirProps = Pick<ReturnType<typeof useWeather>, "weather" | "change"> & { disabled: boolean };

function Air({ weather, change, disabled }: AirProps) {
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
    <>
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
          name="Wind comes from"
          min={0}
          max={355}
          step={5}
          value={direction}
          text={(degrees) => `${degrees.toFixed(0)}°, ${compass(degrees)}`}
          disabled={disabled}
          onChange={(degrees) => blow(blowing, degrees)}
        />
        <Dial
          name="Turbulence"
          min={0}
          max={25}
          step={0.5}
          value={weather.w20}
          text={(w20) => (w20 === 0 ? "none" : `as of ${w20.toFixed(1)} m/s at 6 m`)}
          disabled={disabled}
          onChange={(w20) => change({ w20 })}
        />
        <Group gap="xs">
          <Button
            size="compact-sm"
            variant="light"
            leftSection={<Wind size={15} />}
            disabled={disabled}
            onClick={gust}
          >
            Blow a gust
          </Button>
          <Button
            size="compact-sm"
            variant="subtle"
            leftSection={<CloudSun size={15} />}
            disabled={disabled}
            onClick={() => void attempt("Weather", clearWeather())}
          >
            Calm and clear
          </Button>
        </Group>
      </Section>
      <Section title="Weather">
        <Dial
          name="Rain"
          min={0}
          max={100}
          step={1}
          value={weather.rain}
          text={(rain) => (rain === 0 ? "none" : `${rain.toFixed(0)} mm/h`)}
          disabled={disabled}
          onChange={(rain) => change({ rain })}
        />
        <Dial
          name="Snow"
          min={0}
          max={20}
          step={0.5}
          value={weather.snow}
          text={(snow) => (snow === 0 ? "none" : `${snow.toFixed(1)} mm/h of water`)}
          disabled={disabled}
          onChange={(snow) => change({ snow })}
        />
        {(["fog", "dust"] as const).map((kind) => (
          <Dial
            key={kind}
            name={kind === "fog" ? "Fog" : "Dust"}
            min={0}
            max={100}
            step={1}
            value={positionOfVisibility(weather[`${kind}_visibility`])}
            text={(position) => visibilityText(visibilityOf(position))}
            disabled={disabled}
            onChange={(position) => change({ [`${kind}_visibility`]: visibilityOf(position) })}
          />
        ))}
      </Section>
    </>
  );
}

const POINTS = [
  "north",
  "north-east",
  "east",
  "south-east",
  "south",
  "south-west",
  "west",
  "north-west",
];

function compass(degrees: number): string {
  return POINTS[Math.round(degrees / 45) % 8]!;
}
