import {
  Button,
  Code,
  FileButton,
  Group,
  Loader,
  Modal,
  SimpleGrid,
  Stack,
  Text,
  Title,
} from "@mantine/core";
import { Upload } from "lucide-react";
import { useEffect, useState } from "react";
import { ENDINGS, UPLOAD_HINT } from "../../lib/fileKinds.ts";
import { matcher } from "../../lib/filter.ts";
import { sectionsOf } from "../../lib/sections.ts";
import { scenarios, type ScenarioCard } from "../../link/commands.ts";
import { reasonOf } from "../../state/notices.ts";
import { useSimulation } from "../../state/simulation.ts";
import { closeWindow, offerFiles, useWindows } from "../../state/windows.ts";
import { FilterInput } from "../shared/FilterInput.tsx";
import { Card } from "./Card.tsx";
import { Start } from "./Start.tsx";

/** Image cards of all scenarios; a chosen one is set up and started. */
export default function Scenarios() {
  const wanted = useWindows((windows) => windows.scenario);
  const [cards, setCards] = useState<ScenarioCard[] | null>(null);
  const [problem, setProblem] = useState("");
  const [chosen, setChosen] = useState(wanted);
  useEffect(() => {
    scenarios()
      .then(setCards)
      .catch((error: unknown) => setProblem(reasonOf(error)));
  }, []);
  const card = cards?.find(({ name }) => name === chosen);
  return (
    <Modal
      opened
      onClose={closeWindow}
      size={card === undefined ? 1100 : "lg"}
      title={card === undefined ? "Choose a scenario" : <Named card={card} />}
    >
      {problem !== "" && (
        <Text c="red" role="alert">
          {problem}
        </Text>
      )}
      {cards === null && problem === "" && <Loader />}
      {card !== undefined ? (
        <Start key={card.name} card={card} back={() => setChosen("")} />
      ) : (
        cards !== null && <Gallery cards={cards} choose={setChosen} />
      )}
    </Modal>
  );
}

/** Its name in words, and the one that the command line knows. */
function Named({ card: { name, title } }: { card: ScenarioCard }) {
  if (title === name) return name;
  return (
    <>
      {title} <Code>{name}</Code>
    </>
  );
}

function Gallery({ cards, choose }: { cards: ScenarioCard[]; choose: (name: string) => void }) {
  const [filter, setFilter] = useState("");
  const present = useSimulation(({ server }) => server?.scenario);
  const unasked = useSimulation(({ server }) => server?.unasked ?? false);
  const matches = matcher(filter);
  const shown = cards.filter(({ name, title, section, description, airframes, world }) =>
    matches(`${name} ${title} ${section} ${description} ${airframes.join(" ")} ${world}`),
  );
  return (
    <Stack gap="sm">
      {unasked && (
        <Text size="sm">
          Each card is a flight that you can set up, start and steer. One runs behind this window
          already: close the window to look around there.
        </Text>
      )}
      <Group gap="sm" wrap="nowrap">
        <FilterInput
          label="Search"
          placeholder="Search"
          size="sm"
          flex={1}
          data-autofocus
          value={filter}
          onChange={setFilter}
        />
        <FileButton multiple accept={ENDINGS} onChange={offerFiles}>
          {(props) => (
            <Button variant="default" leftSection={<Upload size={16} />} {...props}>
              Upload a file
            </Button>
          )}
        </FileButton>
      </Group>
      <Text size="xs" c="dimmed">
        Or bring your own: {UPLOAD_HINT}
      </Text>
      {sectionsOf(shown).map(([section, cards]) => (
        <section key={section} aria-label={section}>
          <Title order={3} size="h5" mb={6}>
            {section}
          </Title>
          <SimpleGrid cols={{ base: 1, xs: 2, md: 3, lg: 4 }} spacing="sm">
            {cards.map((card) => (
              <Card
                key={card.name}
                card={card}
                present={card.name === present}
                choose={() => choose(card.name)}
              />
            ))}
          </SimpleGrid>
        </section>
      ))}
      {shown.length === 0 && <Text c="dimmed">No scenario matches all of these words.</Text>}
    </Stack>
  );
}
