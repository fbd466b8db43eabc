// Jobs page: job list, main view, and a URL for each view.

import { API, ApiError, noServer, requestJson } from "../common/api";
import type { components } from "../common/api_types";
import { element, h } from "../common/dom";
import { caughtErrorCard } from "../common/components";
import { Comparison } from "./compare";
import { showActionErrors } from "./components";
import { JobDetail } from "./job_detail";
import { JobFeed } from "./job_feed";
import { JobList } from "./job_list";
import { NewJobForm } from "./new_job_form";
import { PipelineRun } from "./pipeline_run";
import { dataset, datasets, meshes, model, models } from "./resources";
import { CONNECTION, LIST } from "./strings";
import type { View } from "./main_view";

const feed = new JobFeed();
const main = element("main-view", HTMLElement);
const list = new JobList(feed, (ids) => {
  if (ids.length > 1) location.hash = `#compare/${ids.join(",")}`;
  else if (location.hash.startsWith("#compare")) location.hash = `#jobs/${ids[0] ?? ""}`;
});
let view: View | null = null;
const pipeline = new PipelineRun(feed, (error) => main.prepend(caughtErrorCard(error)));
// Error to show instead of the job list if no job server is available.
let serverError: ApiError | null = null;
showActionErrors(main);

const connection = element("connection", HTMLElement);
feed.listen({
  connection: (state) => {
    connection.textContent = CONNECTION[state];
    connection.dataset["state"] = state;
    if (state === "live") view?.retry?.();
  },
});

// View of a route such as "jobs/job_1".
function viewOf(route: string): View | null {
  const [path = "", query = ""] = route.split("?");
  const [section, id = ""] = path.split("/");
  switch (section) {
    case "new":
      return new NewJobForm(feed, pipeline, new URLSearchParams(query));
    case "compare": {
      const ids = id.split(",").slice(0, 6);
      list.mark(ids);
      return new Comparison(feed, ids);
    }
    case "datasets":
      return id ? dataset(id) : datasets();
    case "models":
      return id ? model(id) : models();
    case "meshes":
      return meshes();
    default:
      return id ? new JobDetail(feed, id) : null;
  }
}

function show(): void {
  const route = location.hash.slice(1);
  view?.close?.();
  view = viewOf(route);
  const empty = () => h("div", { class: "empty" }, h("p", { class: "hint" }, LIST.choose), pipeline.panel());
  const placeholder = () => (serverError ? caughtErrorCard(serverError) : empty());
  main.replaceChildren(view?.element ?? placeholder());
  main.scrollTop = 0;
  document.body.classList.toggle("has-main-view", view !== null || serverError !== null);
  list.choose(/^jobs\/(job_\w+)/.exec(route)?.[1] ?? null);
  for (const tab of document.querySelectorAll<HTMLAnchorElement>(".tabs a")) {
    const isCurrent = (tab.hash === "#jobs" ? /^(|jobs.*|compare.*)$/ : new RegExp(`^${tab.hash.slice(1)}`)).test(route);
    if (isCurrent) tab.setAttribute("aria-current", "page");
    else tab.removeAttribute("aria-current");
  }
}

// The error to show if no job server is available: static hosting, or a server without a data directory. Both need the
// same command.
function serverErrorOf(error: unknown): ApiError | null {
  if (!(error instanceof ApiError)) return null;
  const { status, code, detail } = error.problem;
  if (code === "jobs_disabled") return new ApiError(noServer(detail));
  return status === 0 || code === "no_server" ? error : null;
}

// Reloads the page when the server responds, which `cargo xtask demo` is still building.
async function reloadWhenServed(): Promise<void> {
  for (;;) {
    await new Promise((resolve) => setTimeout(resolve, 3000));
    const response = await fetch(new URL("../v1", API)).catch(() => null);
    if (response?.ok) return location.reload();
  }
}

// Whether the server has the program that runs the jobs: `cargo xtask demo` builds it while it serves the page.
async function showWorkerStatus(): Promise<void> {
  const status = element("worker-status", HTMLElement);
  status.textContent = LIST.noWorker;
  for (;;) {
    const { jobs_ready } = await requestJson<components["schemas"]["ApiIndex"]>("../v1");
    status.hidden = jobs_ready;
    if (jobs_ready) return;
    await new Promise((resolve) => setTimeout(resolve, 2000));
  }
}

addEventListener("hashchange", () => {
  // Keyboard users who open a row continue in the main view, not in the next row.
  const isFromList = document.activeElement?.matches("#job-list a") ?? false;
  show();
  // The previous view may have contained the focus.
  if (isFromList || document.activeElement === document.body) main.focus({ preventScroll: true });
});

// A link to the current route fires no event.
document.addEventListener("click", ({ target }) => {
  const link = (target as Element).closest<HTMLAnchorElement>("a[href^='#']");
  if (link && link.hash === location.hash) view?.retry?.();
});

try {
  await feed.loadMore();
} catch (error) {
  serverError = serverErrorOf(error);
  if (!serverError) list.showError(error);
  if (serverError?.problem.status === 503) void reloadWhenServed();
}
element("job-list", HTMLElement).hidden = serverError !== null;
if (!serverError) {
  feed.start();
  showWorkerStatus().catch((error: unknown) => list.showError(error));
}
show();
