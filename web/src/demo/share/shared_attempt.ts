// Restores the attempt of a share link and checks that its final state hash matches.

import type { EventBus } from "../app/event_bus";
import { LINK } from "../app/strings";
import type { FailureEvent, ImportOptions, WorkerRequest } from "../worker/messages";
import type { Frame, ObjectLoaded, Outcome, Ready } from "../worker/protocol";
import type { ShareLink } from "./share_link";

export interface SharedAttemptEvents {
  send(request: WorkerRequest): void;
  report(failure: FailureEvent): void;
  dismiss(code: string): void;
  seek(tick: number): void;
  grasp(seed: number): void;
  // The final state matches the link.
  confirm(): void;
}

export class SharedAttempt {
  readonly #link: ShareLink;
  readonly #events: SharedAttemptEvents;
  #isObjectLoaded = false;
  #hasModel = false;
  #stage: "loading" | "placed" | "running" | "finished" = "loading";

  constructor(bus: EventBus, link: ShareLink, events: SharedAttemptEvents) {
    this.#link = link;
    this.#events = events;
    bus.on("frame", (frame) => this.#showFrame(frame));
    bus.on("outcome", (outcome) => this.#showOutcome(outcome));
  }

  ready({ objects, sceneHash }: Ready): void {
    const { object, sceneHash: linkSceneHash, mesh, options } = this.#link;
    if (sceneHash !== linkSceneHash) this.#report("link_scene_mismatch", LINK.sceneMismatch);
    const index = objects.findIndex(({ name }) => name === object);
    // The worker starts with the first object.
    if (index > 0) this.#events.send({ kind: "loadObject", object });
    if (index >= 0 || mesh) return;
    // Only links to mesh files have a unit or a size. Other objects are in the catalogue, though not in the page's
    // list.
    if (options?.unit || options?.sizeM) this.#report("link_needs_file", LINK.needsFile(object));
    else this.#events.send({ kind: "loadObject", object });
  }

  showObject({ hash, name, label }: ObjectLoaded): void {
    const { objectHash, object, pose, placedByHand, seed } = this.#link;
    this.#isObjectLoaded = hash === objectHash;
    if (this.#stage !== "loading") return;
    if (this.#isObjectLoaded) {
      this.#events.dismiss("link_needs_file");
      this.#events.dismiss("link_object_mismatch");
      this.#events.send(placedByHand ? { kind: "place", pose } : { kind: "placeBySeed", seed });
      this.#stage = "placed";
      this.#startWhenReady();
    } else if (name === object || name === null) {
      this.#report("link_object_mismatch", LINK.objectMismatch(label));
    }
  }

  // Import options of a file. The link's options apply to its own file, and to files without earlier options.
  optionsFor(file: File, earlier?: ImportOptions): ImportOptions | undefined {
    const usesLink = file.name === this.#link.object || earlier === undefined;
    return (this.#stage === "loading" && usesLink ? this.#link.options : null) ?? earlier;
  }

  // The first policy is loaded. A policy that the user selects later is not compared with the link.
  hasModel(hash: string | null): void {
    const { model, modelHash } = this.#link;
    // Null: the policy failed to load, which is already reported.
    if (this.#hasModel || hash === null) return;
    if (modelHash !== null && hash !== modelHash) this.#report("link_model_mismatch", LINK.modelMismatch(model));
    this.#hasModel = true;
    this.#startWhenReady();
  }

  #startWhenReady(): void {
    if (!this.#isObjectLoaded || !this.#hasModel || this.#stage !== "placed") return;
    this.#stage = "running";
    this.#events.grasp(this.#link.seed);
  }

  #showFrame({ ticks, phase }: Frame): void {
    const { tick } = this.#link;
    if (this.#stage !== "finished" || tick === null || phase !== "outcome" || ticks < tick) return;
    this.#events.seek(tick);
    this.#link.tick = null;
  }

  #showOutcome(outcome: Outcome): void {
    if (this.#stage !== "running" || !this.#isOfLink(outcome)) return;
    this.#stage = "finished";
    if (outcome.finalStateHash === this.#link.finalStateHash) this.#events.confirm();
    else this.#report("link_result_mismatch", LINK.resultMismatch);
  }

  // The user may have started another attempt. Poses are compared in single precision, as the worker stores
  // them.
  #isOfLink({ seed, pose, playback, disturbed }: Outcome): boolean {
    const { x, y, yaw } = this.#link.pose;
    const equals = (a: number, b: number) => Math.fround(a) === Math.fround(b);
    const isSame = seed === this.#link.seed && equals(x, pose.x) && equals(y, pose.y) && equals(yaw, pose.yaw);
    return this.#isObjectLoaded && isSame && !playback && !disturbed;
  }

  #report(code: string, text: Pick<FailureEvent, "message" | "hint">): void {
    this.#events.report({ kind: "failure", code, ...text });
  }
}
