// Cards that say what failed and what to do. They stay until closed, or until what stopped begins again, and can be copied.

import { copied, element } from "../../common/dom";
import { isEnd, NOT_FETCHED } from "../engine";
import type { Failure } from "../protocol";
import { FAILURES } from "../strings";

const MOST = 3;

export class Failures {
  readonly #list = element("failures", HTMLElement);
  readonly #template = element("failure-card", HTMLTemplateElement);
  readonly #restart: () => void;
  readonly #fetchAgain: () => void;

  constructor(restart: () => void, fetchAgain: () => void) {
    [this.#restart, this.#fetchAgain] = [restart, fetchAgain];
  }

  show(failure: Failure): void {
    const known = this.#list.querySelector(`[data-code="${CSS.escape(failure.code)}"]`);
    known?.remove();
    this.#list.append(this.#card(failure));
    // What stopped stays, so that it can be begun again.
    const others = [...this.#list.children].filter((card) => !card.classList.contains("is-end"));
    for (const card of others.slice(0, Math.max(0, others.length - MOST))) card.remove();
  }

  // What failed works again.
  close(code: string): void {
    this.#list.querySelector(`[data-code="${CSS.escape(code)}"]`)?.remove();
  }

  #card(failure: Failure): Element {
    const { code, cause, cure } = failure;
    const card = (this.#template.content.cloneNode(true) as DocumentFragment).firstElementChild;
    if (!(card instanceof HTMLElement)) throw new Error("the template holds no card");
    card.dataset["code"] = code;
    card.classList.toggle("is-end", isEnd(failure));
    const part = (selector: string) => card.querySelector<HTMLElement>(selector)!;
    part("h2").textContent = cause;
    part("p").textContent = cure;
    part("code").textContent = code;
    part(".close").hidden = isEnd(failure);
    part(".close").addEventListener("click", () => card.remove());
    part(".copy").addEventListener("click", async () => {
      const text = `${cause}\n${cure}\n${code}, ${navigator.userAgent}`;
      if (await copied(card, text)) part(".copy").textContent = FAILURES.copied;
    });
    const again = this.#again(failure);
    if (again) {
      part(".again").hidden = false;
      part(".again").textContent = again.words;
      part(".again").addEventListener("click", () => {
        card.remove();
        again.act();
      });
    }
    return card;
  }

  // What may do about a failure, if anything may.
  #again(failure: Failure): { words: string; act: () => void } | null {
    if (isEnd(failure)) return { words: FAILURES.restart, act: this.#restart };
    if (failure.code === NOT_FETCHED) return { words: FAILURES.fetchAgain, act: this.#fetchAgain };
    return null;
  }
}
