// The attempt: its buttons, its phases, what it came to, and how attempts came out so far.

import { element } from "../../common/dom";
import type { Frame, Model, Phase, Tally, Verdict } from "../protocol";

const WORDS: Record<Exclude<Phase, "verdict" | "policy">, string> = {
  idle: "Drag the object, or press Grasp.",
  approach: "Moving to the start over the object",
  lift: "Lifting",
  hold: "Holding for two seconds",
};

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
  // Which demonstration is played, if one is.
  #played: string | null = null;
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
  stop(): void {
    this.#hasObject = false;
    this.#actor = null;
    this.#enable();
    this.#headline.textContent = "Stopped";
  }

  // It is known who acts.
  showModel({ id, words, tally }: Model): void {
    this.#actor = id === null ? "planner" : "policy";
    showTally(tally);
    element("model", HTMLElement).textContent = words;
    const phase = this.#phases.querySelector("[data-phase=policy] button");
    if (phase) phase.textContent = id === null ? "Planner" : "Policy";
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

  showFrame({ phase, played }: Frame): void {
    if (phase === this.#phase && played === this.#played) return;
    if (this.#played !== null && played === null) this.#hash.hidden = true;
    [this.#phase, this.#played] = [phase, played];
    if (phase !== "verdict") {
      this.#verdict = null;
      const actor = played === null ? `The ${this.#actor}` : "A demonstration";
      this.#headline.textContent = phase === "policy" ? `${actor} closes the hand` : WORDS[phase];
      if (played !== null) this.#note(`Demonstration: ${played}. No policy acts.`);
    }
    this.#showPhases();
  }

  showVerdict(verdict: Verdict): void {
    this.#verdict = verdict;
    this.#headline.textContent = verdict.words;
    this.#announcement.textContent = `${verdict.words} ${inWords(verdict.tally)}.`;
    const what = verdict.played === null ? `Seed ${verdict.seed}${byHand(verdict)}` : `Demonstration: ${verdict.played}`;
    const end = `ended in state ${verdict.hash.slice(0, 16)}`;
    this.#note(verdict.pulled ? "Somebody pulled at the object: this one does not count." : `${what} ${end}`);
    this.#hash.title = verdict.hash;
    showTally(verdict.tally);
    this.#showPhases();
  }

  // It ended as was said beforehand.
  confirm(): void {
    this.#note(`${this.#hash.textContent}, as in the link`);
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
  if (!placed) return "";
  return `, placed by hand at ${pose.x.toFixed(3)}, ${pose.y.toFixed(3)} m, ${pose.yaw.toFixed(3)} rad,`;
}

function showTally(tally: Tally): void {
  const [least, most] = tally.interval;
  const isNew = tally.attempts === 0;
  element("tally", HTMLElement).textContent = isNew ? "None yet with this object" : inWords(tally);
  element("tally-hint", HTMLElement).textContent = isNew
    ? "A seed fixes the pose, the camera’s noise and the target."
    : `With this object: between ${percent(least)} and ${percent(most)} of attempts, by the 95 % interval. A repeat counts once.`;
  const bar = element("interval", HTMLElement);
  bar.hidden = isNew;
  if (isNew) return;
  const [band, mark] = [bar.querySelector("span"), bar.querySelector("i")];
  if (band) [band.style.left, band.style.right] = [percent(least), percent(1 - most)];
  if (mark) mark.style.left = percent(tally.lifted / tally.attempts);
}

function inWords({ lifted, attempts }: Tally): string {
  return `${lifted} of ${attempts} lifted`;
}

function percent(share: number): string {
  return `${Math.round(share * 100)}%`;
}
