// Somebody came by a link: brings about the attempt that it is of, and says whether it ends as it did there.

import type { Failure, Frame, ObjectLoaded, Ready, Told, ToWorker, Verdict } from "./protocol";
import type { Shared } from "./share";

export interface ArrivalEvents {
  send(message: ToWorker): void;
  tell(failure: Failure): void;
  untell(code: string): void;
  seek(tick: number): void;
  grasp(seed: number): void;
  // It ended as in the link.
  agrees(): void;
}

export class Arrival {
  readonly #shared: Shared;
  readonly #events: ArrivalEvents;
  #isThere = false;
  #hasModel = false;
  #stage: "coming" | "placed" | "trying" | "over" = "coming";

  constructor(shared: Shared, events: ArrivalEvents) {
    this.#shared = shared;
    this.#events = events;
  }

  ready({ objects, scene }: Ready): void {
    const { object, scene: made, mesh } = this.#shared;
    if (scene !== made) this.#tell("link_other_scene", "This link was made with another version of the scene: the attempt may end otherwise.", "Open it where it was made to see it as it was.");
    const at = objects.findIndex(({ name }) => name === object);
    // The first one stands there anyway.
    if (at > 0) this.#events.send({ kind: "load", object });
    else if (at < 0 && !mesh) this.#tell("link_needs_file", `This link is about "${object}", a file that it does not contain.`, "Get the file from whoever sent the link, and drop it here.");
  }

  showObject({ hash, name, label }: ObjectLoaded): void {
    const { objectHash, object, pose, placed, seed } = this.#shared;
    if (this.#stage !== "coming") return;
    if (hash === objectHash) {
      this.#events.untell("link_needs_file");
      this.#events.untell("link_other_object");
      this.#isThere = true;
      this.#events.send(placed ? { kind: "place", pose } : { kind: "randomPose", seed });
      this.#stage = "placed";
      this.#go();
    } else if (name === object || name === null) {
      this.#tell("link_other_object", `${label} is not the object of the link: its shape, mass or friction is another.`, "Look for the very file that the link was made with.");
    }
  }

  // What the link says of the file that it is about.
  get told(): Told | undefined {
    return this.#stage === "coming" ? (this.#shared.told ?? undefined) : undefined;
  }

  // It is known who acts.
  hasModel(hash: string | null): void {
    const { model, modelHash } = this.#shared;
    if (modelHash !== null && hash !== modelHash) this.#tell("link_other_model", `The policy "${model}" is not the one of the link: the attempt may end otherwise.`, "Open it where it was made to see it as it was.");
    this.#hasModel = true;
    this.#go();
  }

  #go(): void {
    if (!this.#isThere || !this.#hasModel || this.#stage !== "placed") return;
    this.#stage = "trying";
    this.#events.grasp(this.#shared.seed);
  }

  showFrame({ ticks, phase }: Frame): void {
    const { tick } = this.#shared;
    if (this.#stage !== "over" || tick === null || phase !== "verdict" || ticks < tick) return;
    this.#events.seek(tick);
    this.#shared.tick = null;
  }

  // Says whether it came to the same.
  showVerdict({ hash }: Verdict): void {
    if (this.#stage !== "trying") return;
    this.#stage = "over";
    if (hash === this.#shared.end) this.#events.agrees();
    else this.#tell("link_other_end", "The attempt ended in another state than in the link.", "Policy, object and scene must be those of the link; compare the notes above.");
  }

  #tell(code: string, cause: string, cure: string): void {
    this.#events.tell({ kind: "failure", code, cause, cure });
  }
}
