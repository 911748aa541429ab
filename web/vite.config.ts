import react from "@vitejs/plugin-react";
import { defineConfig } from "vitest/config";

// `npm run dev` shows the page of these sources with the simulation of `volery serve`.
const server = process.env.VOLERY_SERVER ?? "http://127.0.0.1:8080";

export default defineConfig({
  base: "./", // every URL is relative, so the page works below any prefix of a reverse proxy
  plugins: [react()],
  worker: { format: "es" },
  build: {
    outDir: "../src/volery/server/static",
    emptyOutDir: true,
    target: "es2022",
    chunkSizeWarningLimit: 1200,
  },
  server: {
    host: "127.0.0.1",
    proxy: { "/api": server, "/rosbridge": { target: server, ws: true } },
  },
  test: { environment: "node", include: ["src/**/*.test.{ts,tsx}"] },
});
