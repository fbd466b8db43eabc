// What befalls the page by itself: errors that nobody has foreseen, and a network that goes.

import type { Failure } from "./protocol";
import { FAILURES } from "./strings";

const OFFLINE = "offline";

export function watch(tell: (failure: Failure) => void, untell: (code: string) => void): void {
  const ofPage = (why: string) => {
    // A picture that did not settle within one frame does in the next.
    if (why.includes("ResizeObserver loop")) return;
    tell({ kind: "failure", code: "page_failed", ...FAILURES.ofPage(why) });
  };
  addEventListener("error", ({ message }) => ofPage(message));
  addEventListener("unhandledrejection", ({ reason }) => ofPage(String(reason)));

  // A page that comes from this machine needs no network: whether it answers tells.
  const ask = async () => {
    const answer = await fetch(document.baseURI, { method: "HEAD", cache: "no-store" }).catch(() => null);
    if (!answer && !navigator.onLine) tell({ kind: "failure", code: OFFLINE, ...FAILURES.offline });
  };
  addEventListener("offline", () => void ask());
  addEventListener("online", () => untell(OFFLINE));
  if (!navigator.onLine) void ask();
}
