// Errors outside the worker: uncaught exceptions, rejected promises, loss of the network.

import type { FailureEvent } from "../worker/messages";
import { ERRORS } from "./strings";

const OFFLINE = "offline";

export function reportGlobalErrors(report: (failure: FailureEvent) => void, dismiss: (code: string) => void): void {
  const reportPageError = (why: string) => {
    // Harmless: the layout did not settle within one frame and is finished in the next.
    if (why.includes("ResizeObserver loop")) return;
    report({ kind: "failure", code: "page_error", ...ERRORS.pageError(why) });
  };
  addEventListener("error", ({ message }) => reportPageError(message));
  addEventListener("unhandledrejection", ({ reason }) => reportPageError(String(reason)));

  // A page served from this machine needs no network, so `offline` is verified with a request.
  const checkConnection = async () => {
    const response = await fetch(document.baseURI, { method: "HEAD", cache: "no-store" }).catch(() => null);
    if (!response && !navigator.onLine) report({ kind: "failure", code: OFFLINE, ...ERRORS.offline });
  };
  addEventListener("offline", () => void checkConnection());
  addEventListener("online", () => dismiss(OFFLINE));
  if (!navigator.onLine) void checkConnection();
}
