// Vite plugin: answers API requests of the preview while `cargo xtask demo` builds the server.

import type { Plugin } from "vite";

const PROBLEM = {
  status: 503,
  title: "No server yet",
  code: "no_server",
  detail: "The job server is being built.",
  hint: "The demo works meanwhile. This page reloads when the server is ready.",
};

export function pendingServer(): Plugin {
  return {
    name: "pending-server",
    configurePreviewServer({ middlewares }) {
      if (!process.env["NGF_PENDING_SERVER"]) return;
      middlewares.use("/api/", (_, response) => {
        response.writeHead(503, { "Content-Type": "application/problem+json", "Retry-After": "3" });
        response.end(JSON.stringify(PROBLEM));
      });
    },
  };
}
