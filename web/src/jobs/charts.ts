// All that one job or several measured, a chart for each quantity, with what they have in common set once.

import { h } from "../common/dom";
import { refusal } from "../common/parts";
import { Chart, type Look } from "./chart";
import { Course } from "./course";
import type { Feed } from "./feed";
import { CHARTS } from "./strings";
import { type Job, title } from "./types";

// Quantities that come first.
const FIRST = ["loss", "validation"];
// Drawn again at most so often (ms).
const CALM = 500;

export class Charts {
  readonly element = h("section", { class: "charts", hidden: true });
  readonly #grid = h("div", { class: "grid" });
  // Why what was measured before could not be had.
  readonly #notice = h("div");
  readonly #charts = new Map<string, Chart>();
  readonly #courses: { course: Course; label: string }[];
  readonly #look: Look = remembered();
  #timer = 0;
  // Times that it was asked for: only the last one says how it went.
  #asked = 0;
  #isClosed = false;
  readonly #stop: () => void;

  constructor(feed: Feed, jobs: Job[]) {
    this.element.append(h("h2", {}, CHARTS.title), this.#controls(), this.#notice, this.#grid);
    const began = ({ started_at, created_at }: Job) => Date.parse(started_at ?? created_at);
    this.#courses = jobs.map((job) => ({
      course: new Course(job.id, () => began(feed.jobs.get(job.id) ?? job)),
      label: jobs.length === 1 ? CHARTS.value : title(job),
    }));
    void this.#fetch();
    this.#stop = feed.listen({
      event: (event) => {
        const known = this.#courses.find(({ course }) => course.id === event.job);
        if (event.type === "metric" && known?.course.add(event)) this.#later();
      },
      // What was missed meanwhile is fetched.
      connection: (state) => state === "live" && void this.#fetch(),
    });
  }

  // Draws what could be had, and says why the rest could not.
  async #fetch(): Promise<void> {
    const asked = ++this.#asked;
    const fetched = await Promise.allSettled(this.#courses.map(({ course }) => course.fetch()));
    if (asked !== this.#asked) return;
    const refused = fetched.find(({ status }) => status === "rejected") as PromiseRejectedResult | undefined;
    this.#notice.replaceChildren(...(refused ? [refusal(refused.reason)] : []));
    this.#draw();
  }

  close(): void {
    this.#isClosed = true;
    this.#stop();
    clearTimeout(this.#timer);
    for (const chart of this.#charts.values()) chart.close();
  }

  #later(): void {
    this.#timer ||= window.setTimeout(() => {
      this.#timer = 0;
      this.#draw();
    }, CALM);
  }

  #draw(): void {
    // What was fetched may come when nobody looks any more.
    if (this.#isClosed) return;
    const names = [...new Set(this.#courses.flatMap(({ course }) => course.names()))];
    const rank = (name: string) => (FIRST.findIndex((first) => name.startsWith(first)) + FIRST.length + 1) % (FIRST.length + 1);
    names.sort((a, b) => rank(a) - rank(b));
    this.element.hidden = names.length === 0 && this.#notice.childElementCount === 0;
    for (const name of names) {
      let chart = this.#charts.get(name);
      if (!chart) {
        chart = new Chart(name);
        this.#charts.set(name, chart);
        this.#grid.append(chart.element);
      }
      chart.show(this.#courses, this.#look);
    }
  }

  #controls(): HTMLElement {
    const look = this.#look;
    const set = () => {
      sessionStorage.setItem(KEY, JSON.stringify(look));
      this.#draw();
    };
    const box = (text: string, name: "isLogX" | "isLogY") => {
      const input = h("input", { type: "checkbox", change: () => ((look[name] = input.checked), set()) });
      input.checked = look[name];
      return h("label", {}, input, text);
    };
    const slider = h("input", {
      type: "range",
      min: 0,
      max: 0.99,
      step: 0.01,
      input: () => ((look.smoothing = slider.valueAsNumber), set()),
    });
    slider.valueAsNumber = look.smoothing;
    const by = h(
      "select",
      { "aria-label": CHARTS.axis, change: () => ((look.by = by.value as Look["by"]), set()) },
      h("option", { value: "step" }, CHARTS.byStep),
      h("option", { value: "wall" }, CHARTS.byTime),
    );
    by.value = look.by;
    const hint = h("span", { class: "hint" }, CHARTS.hint);
    return h("div", { class: "controls" }, h("label", {}, CHARTS.smoothing, slider), box(CHARTS.logY, "isLogY"), box(CHARTS.logX, "isLogX"), by, hint);
  }
}

const KEY = "ngf-charts";

function remembered(): Look {
  const standard: Look = { smoothing: 0.6, isLogY: true, isLogX: false, by: "step" };
  try {
    return { ...standard, ...(JSON.parse(sessionStorage.getItem(KEY) ?? "{}") as Partial<Look>) };
  } catch {
    return standard;
  }
}
