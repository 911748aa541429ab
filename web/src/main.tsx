import "@mantine/core/styles.css";
import "@mantine/notifications/styles.css";
import "./app/page.css";
import { MantineProvider } from "@mantine/core";
import { Notifications } from "@mantine/notifications";
import { createRoot } from "react-dom/client";
import { App } from "./app/App.tsx";
import { theme } from "./app/theme.ts";
import { link } from "./link/link.ts";
import { followAddress } from "./state/addressed.ts";
import { connectAsAddressed, useConnection } from "./state/connection.ts";
import { followHealth } from "./state/health.ts";
import { followJournal } from "./state/journal.ts";
import { followEpoch } from "./state/epoch.ts";
import { followGoals } from "./state/goals.ts";
import { followPlayer } from "./state/player.ts";
import { showFailure } from "./state/notices.ts";
import { followDisconnection, useOperator } from "./state/operator.ts";
import { followRestarts } from "./state/restarts.ts";
import { followSilence } from "./state/silence.ts";
import { followSimulation } from "./state/simulation.ts";
import { hideToken } from "./state/token.ts";
import { followTopics } from "./state/topics.ts";
import { followFaults } from "./state/faults.ts";
import { welcome } from "./state/welcome.ts";
import { followVerdicts } from "./state/verdicts.ts";
import { followVehicles } from "./state/vehicles.ts";

hideToken(location, history);
welcome(location.hash);
followAddress();
connectAsAddressed(location, useOperator.getState().wished);
followDisconnection();
followSimulation(useConnection.getState().volery);
followFaults();
followVerdicts();
followVehicles(useConnection.getState().volery);
followHealth();
followJournal();
followPlayer();
followEpoch();
followGoals();
followRestarts();
followSilence();
followTopics();
link.onComplaint = (text) => showFailure("The simulation refused a message", text);

createRoot(document.getElementById("root")!).render(
  <MantineProvider theme={theme} defaultColorScheme="auto">
    <Notifications position="top-center" />
    <App />
  </MantineProvider>,
);
