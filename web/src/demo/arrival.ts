// Somebody came by a link: brings about the attempt that it is of, and says whether it ends as it did there.

import type { Failure, Frame, ObjectLoaded, Ready, Told, ToWorker, Verdict } from "./protocol";
import type { Shared } from "./share";
import { LINK } from "./strings";

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
    const { object, scene: made, mesh, told } = this.#shared;
    if (scene !== made) this.#tell("link_other_scene", LINK.otherScene);
    const at = objects.findIndex(({ name }) => name === object);
    // The first one stands there anyway.
    if (at > 0) this.#events.send({ kind: "load", object });
    if (at >= 0 || mesh) return;
    // Of a file it says in what unit that was read; what is built in need not be on the shelf.
    if (told?.unit) this.#tell("link_needs_file", LINK.needsFile(object));
    else this.#events.send({ kind: "load", object });
  }

  showObject({ hash, name, label }: ObjectLoaded): void {
    const { objectHash, object, pose, placed, seed } = this.#shared;
    this.#isThere = hash === objectHash;
    if (this.#stage !== "coming") return;
    if (this.#isThere) {
      this.#events.untell("link_needs_file");
      this.#events.untell("link_other_object");
      this.#events.send(placed ? { kind: "place", pose } : { kind: "randomPose", seed });
      this.#stage = "placed";
      this.#go();
    } else if (name === object || name === null) {
      this.#tell("link_other_object", LINK.otherObject(label));
    }
  }

  // What is to be said of a file: what the link says of its own, and of one of which nothing was said before.
  told(file: File, before?: Told): Told | undefined {
    const isIts = file.name === this.#shared.object || before === undefined;
    return (this.#stage === "coming" && isIts ? this.#shared.told : null) ?? before;
  }

  // It is known who acts: the first policy that comes. Whoever chooses another one since knows that the link is of another.
  hasModel(hash: string | null): void {
    const { model, modelHash } = this.#shared;
    // It did not come yet, which is told already.
    if (this.#hasModel || hash === null) return;
    if (modelHash !== null && hash !== modelHash) this.#tell("link_other_model", LINK.otherModel(model));
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
  showVerdict(verdict: Verdict): void {
    const { hash } = verdict;
    if (this.#stage !== "trying" || !this.#isOf(verdict)) return;
    this.#stage = "over";
    if (hash === this.#shared.end) this.#events.agrees();
    else this.#tell("link_other_end", LINK.otherEnd);
  }

  // Whoever has taken over may have begun another attempt. A pose has single precision, however it was written.
  #isOf({ seed, pose, played, pulled }: Verdict): boolean {
    const { x, y, yaw } = this.#shared.pose;
    const isThat = (told: number, found: number) => Math.fround(told) === Math.fround(found);
    const isSame = seed === this.#shared.seed && isThat(x, pose.x) && isThat(y, pose.y) && isThat(yaw, pose.yaw);
    return this.#isThere && isSame && !played && !pulled;
  }

  #tell(code: string, told: Pick<Failure, "cause" | "cure">): void {
    this.#events.tell({ kind: "failure", code, ...told });
  }
}
