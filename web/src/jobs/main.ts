// The jobs page: a list, what was chosen in it, and an address for everything.

import { noServer, Refused } from "../common/api";
import { element, h } from "../common/dom";
import { refusal } from "../common/parts";
import { Comparison } from "./compare";
import { Detail } from "./detail";
import { Feed } from "./feed";
import { NewJob } from "./form";
import { dataset, datasets, meshes, model, models } from "./library";
import { tellRefusals } from "./parts";
import { Rail } from "./rail";
import { CONNECTION, LIST } from "./strings";
import type { View } from "./view";

const feed = new Feed();
const detail = element("detail", HTMLElement);
const rail = new Rail(feed, (ids) => {
  if (ids.length > 1) location.hash = `#compare/${ids.join(",")}`;
  else if (location.hash.startsWith("#compare")) location.hash = `#jobs/${ids[0] ?? ""}`;
});
let view: View | null = null;
// Why there is no list at all.
let absence: Refused | null = null;
tellRefusals(detail);

const connection = element("connection", HTMLElement);
feed.listen({
  connection: (state) => {
    connection.textContent = CONNECTION[state];
    connection.dataset["state"] = state;
  },
});

// What "#jobs/job_1" and the like lead to.
function viewOf(route: string): View | null {
  const [path = "", query = ""] = route.split("?");
  const [place, id = ""] = path.split("/");
  switch (place) {
    case "new":
      return new NewJob(feed, new URLSearchParams(query));
    case "compare": {
      const ids = id.split(",").slice(0, 6);
      rail.mark(ids);
      return new Comparison(feed, ids);
    }
    case "datasets":
      return id ? dataset(id) : datasets();
    case "models":
      return id ? model(id) : models();
    case "meshes":
      return meshes();
    default:
      return id ? new Detail(feed, id) : null;
  }
}

function show(): void {
  const route = location.hash.slice(1);
  view?.close?.();
  view = viewOf(route);
  const otherwise = () => (absence ? refusal(absence) : h("p", { class: "empty hint" }, LIST.choose));
  detail.replaceChildren(view?.element ?? otherwise());
  detail.scrollTop = 0;
  document.body.classList.toggle("has-detail", view !== null || absence !== null);
  rail.choose(/^jobs\/(job_\w+)/.exec(route)?.[1] ?? null);
  for (const tab of document.querySelectorAll<HTMLAnchorElement>(".tabs a")) {
    const isHere = (tab.hash === "#jobs" ? /^(|jobs.*|compare.*)$/ : new RegExp(`^${tab.hash.slice(1)}`)).test(route);
    if (isHere) tab.setAttribute("aria-current", "page");
    else tab.removeAttribute("aria-current");
  }
}

// Nobody does jobs here: there are files alone, or the server has no folder for jobs. What to start is the same.
function absenceOf(error: unknown): Refused | null {
  if (!(error instanceof Refused)) return null;
  const { status, code, detail } = error.problem;
  if (code === "jobs_disabled") return new Refused(noServer(detail));
  return status === 0 ? error : null;
}

addEventListener("hashchange", () => {
  // Whoever follows a row of the list by keyboard goes on with what it leads to, not with the rows after it.
  const isFollowed = document.activeElement?.matches("#rail a") ?? false;
  show();
  // What had the focus may be gone with the view before.
  if (isFollowed || document.activeElement === document.body) detail.focus({ preventScroll: true });
});

try {
  await feed.more();
} catch (error) {
  absence = absenceOf(error);
  if (!absence) rail.refuse(error);
}
element("rail", HTMLElement).hidden = absence !== null;
if (!absence) feed.start();
show();
