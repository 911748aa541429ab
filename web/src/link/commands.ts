// What the page asks of a simulation, each as one function. Failures reject with the reason.

export * from "./commands/requests.ts";
export * from "./commands/typeDescriptions.ts";
export * from "./commands/entities.ts";
export * from "./commands/environment.ts";
export * from "./commands/faults.ts";
export * from "./commands/flight.ts";
export * from "./commands/graph.ts";
export * from "./commands/controlAuthority.ts";
export * from "./commands/recordings.ts";
export * from "./commands/scenarios.ts";
export * from "./commands/simulation.ts";
