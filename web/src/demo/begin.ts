// Begins the page: the engine, and while it comes, all else.

import { beginEarly } from "./first";

beginEarly();
import("./main").catch((error: unknown) => {
  // Nothing else of the page is there that could say so.
  for (const [id, hidden] of [["headline", true], ["broken", false]] as const) {
    const words = document.getElementById(id);
    if (words) words.hidden = hidden;
  }
  throw error;
});
