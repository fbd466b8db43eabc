// The attempt: its buttons, its phases, what it came to, and how attempts came out so far.

import { element } from "../../common/dom";
import { percent } from "../../common/numbers";
import type { Frame, Model, Phase, Played, Tally, Verdict } from "../protocol";
import { ATTEMPT, TALLY } from "../strings";

export interface AttemptEvents {
  grasp(seed: number): void;
  pose(seed: number): void;
}

export class AttemptPanel {
  readonly #events: AttemptEvents;
  readonly #headline = element("headline", HTMLElement);
  readonly #announcement = element("announcement", HTMLElement);
  readonly #phases = element("phases", HTMLOListElement);
  readonly #grasp = element("grasp", HTMLButtonElement);
  readonly #newPose = element("new-pose", HTMLButtonElement);
  readonly #seed = element("seed", HTMLInputElement);
  readonly #hash = element("hash", HTMLElement);
  #verdict: Verdict | null = null;
  #phase: Phase | null = null;
  #played: Played | null = null;
  // The seed that the pose on the table was drawn from.
  #poseSeed = 0;
  #hasObject = false;
  // Who closes the hand, once that is known.
  #actor: "policy" | "planner" | null = null;

  constructor(events: AttemptEvents) {
    this.#events = events;
    this.#grasp.addEventListener("click", () => this.grasp());
    this.#newPose.addEventListener("click", () => this.newPose());
    this.#seed.addEventListener("change", () => this.#drawPose());
    // A seed that is already there draws its pose too, when it is confirmed.
    this.#seed.addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.#drawPose();
    });
  }

  // There is an object to grasp, and perhaps it has been tried.
  hasObject(tally: Tally): void {
    this.#hasObject = true;
    this.#hash.hidden = true;
    showTally(tally);
    this.#enable();
  }

  // Nothing can be tried until there is an object and somebody who acts.
  stop(headline: string): void {
    this.#hasObject = false;
    // Whatever phase comes next is told anew.
    [this.#actor, this.#phase] = [null, null];
    this.#enable();
    this.#headline.textContent = headline;
  }

  // It is known who acts.
  showModel({ id, words, tally }: Model): void {
    this.#actor = id === null ? "planner" : "policy";
    showTally(tally);
    element("model", HTMLElement).textContent = words;
    this.#announcement.textContent = words;
    const phase = this.#phases.querySelector("[data-phase=policy] button");
    if (phase) phase.textContent = id === null ? ATTEMPT.planner : ATTEMPT.policy;
    this.#enable();
  }

  #enable(): void {
    this.#newPose.disabled = !this.#hasObject;
    this.#grasp.disabled = !(this.#hasObject && this.#actor);
  }

  grasp(): void {
    if (!this.#grasp.disabled) this.#events.grasp(this.#seedValue());
  }

  get seed(): number {
    return this.#seedValue();
  }

  // The attempt of this seed, where the object stands.
  tryAgain(seed: number): void {
    this.#seed.value = String(seed);
    this.#poseSeed = seed;
    this.grasp();
  }

  // The attempt of this seed, where it puts the object.
  show(seed: number): void {
    this.#seed.value = String(seed);
    this.#drawPose();
    this.grasp();
  }

  showTally(tally: Tally): void {
    showTally(tally);
  }

  newPose(): void {
    if (this.#newPose.disabled) return;
    if (this.#seedValue() === this.#poseSeed) this.#seed.value = String(this.#poseSeed + 1);
    this.#drawPose();
  }

  #drawPose(): void {
    this.#poseSeed = this.#seedValue();
    this.#events.pose(this.#poseSeed);
  }

  showFrame({ phase, played, marks }: Frame): void {
    // Looking back at an attempt that has ended changes nothing of how it did.
    if (this.#verdict && !marks.some(([phase]) => phase === "verdict")) {
      this.#verdict = null;
      this.#hash.hidden = true;
    }
    if (phase === this.#phase && played?.what === this.#played?.what) return;
    if (this.#played && !played) this.#hash.hidden = true;
    [this.#phase, this.#played] = [phase, played];
    if (phase === "verdict") {
      if (this.#verdict) this.#headline.textContent = this.#verdict.words;
    } else {
      const closes = played?.closes ?? ATTEMPT.closes(this.#actor ?? "policy");
      this.#headline.textContent = phase === "policy" ? closes : ATTEMPT.phases[phase];
      if (played && !this.#verdict) this.#note(ATTEMPT.noPolicy(played.what));
    }
    this.#showPhases();
  }

  showVerdict(verdict: Verdict): void {
    this.#verdict = verdict;
    this.#headline.textContent = verdict.words;
    this.#announcement.textContent = `${verdict.words} ${TALLY.lifted(verdict.tally)}.`;
    const what = verdict.played?.what ?? ATTEMPT.seed(verdict.seed) + byHand(verdict);
    this.#note(verdict.pulled ? ATTEMPT.pulled : ATTEMPT.ended(what, verdict.hash.slice(0, 16)));
    this.#hash.title = verdict.hash;
    const end = verdict.pulled ? null : verdict.played?.end;
    if (end != null) this.#note((end === verdict.hash ? ATTEMPT.asRecorded : ATTEMPT.notAsRecorded)(this.#hash.textContent));
    showTally(verdict.tally);
    this.#showPhases();
  }

  // It ended as was said beforehand.
  confirm(): void {
    this.#note(ATTEMPT.asInLink(this.#hash.textContent));
  }

  #note(text: string): void {
    this.#hash.hidden = false;
    this.#hash.textContent = text;
  }

  #showPhases(): void {
    const items = [...this.#phases.querySelectorAll("li")];
    const now = items.findIndex((item) => item.dataset["phase"] === this.#phase);
    items.forEach((item, index) => {
      item.classList.toggle("is-done", index < now);
      item.classList.toggle("is-now", index === now);
      if (index === now) item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
    });
    this.#phases.classList.toggle("is-missed", this.#verdict?.lifted === false);
  }

  #seedValue(): number {
    const value = Math.trunc(this.#seed.valueAsNumber);
    return Number.isFinite(value) ? Math.min(0xffffffff, Math.max(0, value)) : 0;
  }
}

function byHand({ placed, pose }: Verdict): string {
  return placed ? ATTEMPT.byHand(pose.x.toFixed(3), pose.y.toFixed(3), pose.yaw.toFixed(3)) : "";
}

function showTally(tally: Tally): void {
  const [least, most] = tally.interval;
  const isNew = tally.attempts === 0;
  element("tally", HTMLElement).textContent = isNew ? TALLY.none : TALLY.lifted(tally);
  element("tally-hint", HTMLElement).textContent = isNew ? TALLY.hint : TALLY.interval(percent(least), percent(most));
  const bar = element("interval", HTMLElement);
  bar.hidden = isNew;
  if (isNew) return;
  const [band, mark] = [bar.querySelector("span"), bar.querySelector("i")];
  if (band) [band.style.left, band.style.right] = [`${100 * least}%`, `${100 * (1 - most)}%`];
  if (mark) mark.style.left = `${(100 * tally.lifted) / tally.attempts}%`;
}
