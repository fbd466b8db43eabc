// Error cards: message, hint and code of a failure. A card stays until the user closes it or the cause is
// resolved.

import { copyText, element, withCode } from "../../common/dom";
import { ERRORS } from "../app/strings";
import type { FailureEvent } from "../worker/messages";
import { DOWNLOAD_FAILED, isFatal } from "../worker/worker_client";

// Maximum number of cards that are not fatal.
const MAX_CARDS = 3;

export class ErrorCards {
  readonly #list = element("failures", HTMLElement);
  readonly #template = element("failure-card", HTMLTemplateElement);
  readonly #restart: () => void;
  readonly #retryDownload: () => void;

  constructor(restart: () => void, retryDownload: () => void) {
    [this.#restart, this.#retryDownload] = [restart, retryDownload];
  }

  // `form` resolves the failure; it is shown below the hint.
  show(failure: FailureEvent, form?: HTMLFormElement): void {
    this.dismiss(failure.code);
    const card = this.#card(failure);
    if (form) card.querySelector("p")?.after(form);
    this.#list.append(card);
    // Fatal cards stay, since they hold the restart button.
    const others = [...this.#list.children].filter((card) => !card.classList.contains("is-fatal"));
    for (const card of others.slice(0, Math.max(0, others.length - MAX_CARDS))) card.remove();
  }

  report(code: string, text: Pick<FailureEvent, "message" | "hint">): void {
    this.show({ kind: "failure", code, ...text });
  }

  dismiss(code: string): void {
    this.#list.querySelector(`[data-code="${CSS.escape(code)}"]`)?.remove();
  }

  #card(failure: FailureEvent): Element {
    const { code, message, hint } = failure;
    const card = (this.#template.content.cloneNode(true) as DocumentFragment).firstElementChild;
    if (!(card instanceof HTMLElement)) throw new Error("the template has no card");
    card.dataset["code"] = code;
    card.classList.toggle("is-fatal", isFatal(failure));
    const part = (selector: string) => card.querySelector<HTMLElement>(selector)!;
    part("h2").textContent = message;
    part("p").replaceChildren(...withCode(hint));
    part("code").textContent = code;
    part(".close").hidden = isFatal(failure);
    part(".close").addEventListener("click", () => card.remove());
    part(".copy").addEventListener("click", async () => {
      const text = `${message}\n${hint}\n${code}, ${navigator.userAgent}`;
      if (await copyText(card, text)) part(".copy").textContent = ERRORS.copied;
    });
    const retry = this.#retry(failure);
    if (retry) {
      part(".retry").hidden = false;
      part(".retry").textContent = retry.label;
      part(".retry").addEventListener("click", () => {
        card.remove();
        retry.act();
      });
    }
    return card;
  }

  // Action that can resolve a failure.
  #retry(failure: FailureEvent): { label: string; act: () => void } | null {
    if (isFatal(failure)) return { label: ERRORS.restart, act: this.#restart };
    if (failure.code === DOWNLOAD_FAILED) return { label: ERRORS.retryDownload, act: this.#retryDownload };
    return null;
  }
}
