import { Button, Paper } from "@mantine/core";
import { useCallback, useEffect, useState } from "react";
import { emptyOf, fieldsOf, type Field } from "../../lib/typeDefinitions.ts";
import { messageDefinitions } from "../../link/commands.ts";
import { link } from "../../link/link.ts";
import { MessageForm } from "../shared/MessageForm.tsx";
import { Reason } from "../shared/Reason.tsx";
import { useRequest } from "../shared/useRequest.ts";

const NONE: Field[] = [];

/** Write a message and publish it. */
export function PublishForm({ topic, type }: { topic: string; type: string }) {
  const describe = useCallback(async () => fieldsOf(await messageDefinitions(type)), [type]);
  const { value: fields, reason } = useRequest(describe, NONE);
  const [message, setMessage] = useState<Record<string, unknown>>({});
  useEffect(() => setMessage(emptyOf(fields)), [fields]);
  return (
    <Paper withBorder p="xs" mb="xs" maw={520}>
      <Reason>{reason}</Reason>
      <MessageForm key={fields.length} fields={fields} value={message} onChange={setMessage} />
      <Button size="compact-sm" mt="xs" onClick={() => link.publish(topic, type, message)}>
        Publish to {topic}
      </Button>
    </Paper>
  );
}
