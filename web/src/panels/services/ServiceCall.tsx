import { Button, Group, Text } from "@mantine/core";
import { useCallback, useEffect, useState } from "react";
import { emptyOf, fieldsOf, type Field } from "../../lib/typeDefinitions.ts";
import { requestDefinitions, serviceType } from "../../link/commands.ts";
import { link } from "../../link/link.ts";
import { MessageForm } from "../shared/MessageForm.tsx";
import { Reason } from "../shared/Reason.tsx";
import { useRequest } from "../shared/useRequest.ts";
import { ValueTree } from "../shared/ValueTree.tsx";
import classes from "./Services.module.css";

interface Described {
  type: string;
  fields: Field[];
}

interface Answered {
  answer: unknown;
  reason: string;
  tookMs: number;
}

const UNKNOWN: Described = { type: "", fields: [] };
const TIMEOUT_S = 60;

/** A form for one service, and what it answered. */
export function ServiceCall({ service }: { service: string }) {
  const describe = useCallback(async () => {
    const type = await serviceType(service);
    return { type, fields: fieldsOf(await requestDefinitions(type)) };
  }, [service]);
  const { value: described, reason } = useRequest(describe, UNKNOWN);
  const [request, setRequest] = useState<Record<string, unknown>>({});
  const [answered, setAnswered] = useState<Answered | null>(null);
  const [waiting, setWaiting] = useState(false);
  useEffect(() => setRequest(emptyOf(described.fields)), [described]);

  const call = async () => {
    setWaiting(true);
    const began = performance.now();
    const done = (answer: unknown, why: string) =>
      setAnswered({ answer, reason: why, tookMs: performance.now() - began });
    try {
      done(await link.call(service, described.type, request, TIMEOUT_S), "");
    } catch (error) {
      done(null, error instanceof Error ? error.message : String(error));
    }
    setWaiting(false);
  };

  return (
    <form
      aria-label={`Call ${service}`}
      onSubmit={(event) => {
        event.preventDefault();
        void call();
      }}
    >
      <Text size="sm" ff="monospace">
        {service} <Text span inherit c="dimmed">{`(${described.type})`}</Text>
      </Text>
      <Reason>{reason}</Reason>
      <div className={classes.sides}>
        <div>
          <MessageForm
            key={described.type}
            fields={described.fields}
            value={request}
            onChange={setRequest}
          />
          <Button
            type="submit"
            size="compact-sm"
            mt="xs"
            loading={waiting}
            disabled={described.type === ""}
          >
            Call
          </Button>
        </div>
        {answered !== null && (
          <div aria-label="Response" role="region">
            <Group gap={6}>
              <Text size="xs" c="dimmed">
                Response after {answered.tookMs.toFixed(0)} ms
              </Text>
            </Group>
            <Reason>{answered.reason}</Reason>
            <ValueTree value={answered.answer} />
          </div>
        )}
      </div>
    </form>
  );
}
