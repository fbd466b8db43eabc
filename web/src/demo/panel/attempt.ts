// Attempt section: buttons, phases, outcome and tally.

import { element } from "../../common/dom";
import { percent } from "../../common/numbers";
import type { EventBus } from "../app/event_bus";
import { ATTEMPT, TALLY } from "../app/strings";
import type { Frame, Model, Outcome, Phase, PlaybackInfo, Tally } from "../worker/protocol";

export interface AttemptEvents {
  grasp(seed: number): void;
  placeBySeed(seed: number): void;
}

export class AttemptPanel {
  readonly #events: AttemptEvents;
  readonly #headline = element("headline", HTMLElement);
  readonly #evidence = element("evidence", HTMLElement);
  readonly #announcement = element("announcement", HTMLElement);
  readonly #phases = element("phases", HTMLOListElement);
  readonly #grasp = element("grasp", HTMLButtonElement);
  readonly #newPose = element("new-pose", HTMLButtonElement);
  readonly #seed = element("seed", HTMLInputElement);
  readonly #note = element("hash", HTMLElement);
  #outcome: Outcome | null = null;
  #phase: Phase | null = null;
  #playback: PlaybackInfo | null = null;
  // Seed from which the current object pose was sampled.
  #poseSeed = 0;
  #hasObject = false;
  // Known once the worker has reported its model.
  #actor: "policy" | "planner" | null = null;

  constructor(bus: EventBus, events: AttemptEvents) {
    this.#events = events;
    bus.on("object", ({ tally }) => this.#showObject(tally));
    bus.on("model", (model) => this.#showModel(model));
    bus.on("frame", (frame) => this.#showFrame(frame));
    bus.on("outcome", (outcome) => this.#showOutcome(outcome));
    bus.on("attemptFinished", ({ tally }) => showTally(tally));
    bus.on("stopped", ({ headline }) => this.#stop(headline));
    this.#grasp.addEventListener("click", () => this.grasp());
    this.#newPose.addEventListener("click", () => this.newPose());
    this.#seed.addEventListener("change", () => this.#placeBySeed());
    // An unchanged seed fires no change event, but Enter places the object again.
    this.#seed.addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.#placeBySeed();
    });
    this.#seed.addEventListener("blur", () => this.#rejectInvalidSeed());
  }

  // `tally`: earlier attempts with this object.
  #showObject(tally: Tally): void {
    this.#hasObject = true;
    this.#note.hidden = true;
    showTally(tally);
    this.#enable();
  }

  // Disables the buttons until an object and a model are reported.
  #stop(headline: string): void {
    this.#hasObject = false;
    // Resets the phase, so that the next frame updates the headline.
    [this.#actor, this.#phase] = [null, null];
    this.#enable();
    this.#headline.textContent = headline;
    this.#evidence.hidden = true;
  }

  #showModel({ id, text, tally }: Model): void {
    this.#actor = id === null ? "planner" : "policy";
    showTally(tally);
    element("model", HTMLElement).textContent = text;
    this.#announcement.textContent = text;
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

  // Runs an attempt with this seed at the current object pose.
  graspWithSeed(seed: number): void {
    this.#seed.value = String(seed);
    this.#poseSeed = seed;
    this.grasp();
  }

  // Runs an attempt with this seed at the object pose that it samples.
  runSeed(seed: number): void {
    this.#seed.value = String(seed);
    this.#placeBySeed();
    this.grasp();
  }

  newPose(): void {
    if (this.#newPose.disabled) return;
    if (this.#seedValue() === this.#poseSeed) this.#seed.value = String(this.#poseSeed + 1);
    this.#placeBySeed();
  }

  // Replaces an invalid seed by the last one. It places no object, so an attempt under way continues.
  #rejectInvalidSeed(): boolean {
    if (this.#seed.value !== "" && this.#seed.validity.valid) return false;
    this.#seed.value = String(this.#poseSeed);
    this.#announcement.textContent = ATTEMPT.invalidSeed;
    return true;
  }

  #placeBySeed(): void {
    if (this.#rejectInvalidSeed()) return;
    this.#poseSeed = this.#seedValue();
    this.#events.placeBySeed(this.#poseSeed);
  }

  #showFrame({ phase, playback, phaseStarts }: Frame): void {
    // The outcome stays while the user scrubs through the attempt; a new attempt has no outcome phase.
    if (this.#outcome && !phaseStarts.some(([phase]) => phase === "outcome")) {
      this.#outcome = null;
      this.#note.hidden = true;
    }
    if (phase === this.#phase && playback?.description === this.#playback?.description) return;
    if (this.#playback && !playback) this.#note.hidden = true;
    [this.#phase, this.#playback] = [phase, playback];
    this.#evidence.hidden = phase !== "outcome" || this.#outcome?.evidence == null;
    if (phase === "outcome") {
      if (this.#outcome) this.#headline.textContent = this.#outcome.text;
    } else {
      const grasping = playback?.closingLabel ?? ATTEMPT.grasping(this.#actor ?? "policy");
      this.#headline.textContent = phase === "policy" ? grasping : ATTEMPT.phases[phase];
      if (playback && !this.#outcome) this.#showNote(ATTEMPT.noPolicy(playback.description));
    }
    this.#showPhases();
  }

  #showOutcome(outcome: Outcome): void {
    this.#outcome = outcome;
    this.#headline.textContent = outcome.text;
    this.#evidence.hidden = outcome.evidence === null;
    this.#evidence.textContent = outcome.evidence && `${outcome.evidence} ${ATTEMPT.settling}`;
    const announcement = [outcome.text, outcome.evidence, `${TALLY.lifted(outcome.tally)}.`];
    this.#announcement.textContent = announcement.filter(Boolean).join(" ");
    const pose = outcome.placedByHand ? ATTEMPT.customPose : "";
    const attempt = outcome.playback?.description ?? ATTEMPT.seed(outcome.seed) + pose;
    this.#showNote(outcome.disturbed ? ATTEMPT.disturbed : ATTEMPT.finalState(attempt, outcome.finalStateHash.slice(0, 16)));
    this.#note.title = outcome.finalStateHash;
    const recorded = outcome.disturbed ? null : outcome.playback?.finalStateHash;
    if (recorded != null) {
      const matches = recorded === outcome.finalStateHash;
      this.#showNote((matches ? ATTEMPT.matchesRecording : ATTEMPT.differsFromRecording)(this.#note.textContent));
    }
    showTally(outcome.tally);
    this.#showPhases();
  }

  // The final state matches the share link.
  confirmLink(): void {
    this.#showNote(ATTEMPT.matchesLink(this.#note.textContent));
  }

  #showNote(text: string): void {
    this.#note.hidden = false;
    this.#note.textContent = text;
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
    this.#phases.classList.toggle("is-missed", this.#outcome?.lifted === false);
  }

  #seedValue(): number {
    const value = Math.trunc(this.#seed.valueAsNumber);
    return Number.isFinite(value) ? Math.min(0xffffffff, Math.max(0, value)) : 0;
  }
}

function showTally(tally: Tally): void {
  const [min, max] = tally.interval;
  const isEmpty = tally.attempts === 0;
  element("tally", HTMLElement).textContent = isEmpty ? TALLY.none : TALLY.lifted(tally);
  element("tally-hint", HTMLElement).textContent = isEmpty ? TALLY.hint : TALLY.interval(percent(min), percent(max));
  const bar = element("interval", HTMLElement);
  bar.hidden = isEmpty;
  if (isEmpty) return;
  const [band, mark] = [bar.querySelector("span"), bar.querySelector("i")];
  if (band) [band.style.left, band.style.right] = [`${100 * min}%`, `${100 * (1 - max)}%`];
  if (mark) mark.style.left = `${(100 * tally.lifted) / tally.attempts}%`;
}
