// Entry of the page: starts the worker, then loads the rest of the page in parallel.

import { startEarly } from "../worker/early_worker";

startEarly();
import("./app").catch((error: unknown) => {
  // The error cards are part of the module that failed to load, so the static text is shown.
  for (const [id, hidden] of [["headline", true], ["broken", false]] as const) {
    const paragraph = document.getElementById(id);
    if (paragraph) paragraph.hidden = hidden;
  }
  throw error;
});
