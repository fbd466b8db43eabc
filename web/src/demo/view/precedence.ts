// Where the processor draws, a picture in the making keeps all else on the page waiting: whoever does something is answered
// first, and the picture comes after.

const DEEDS = ["keydown", "keyup", "pointerdown", "pointerup"];
// The picture waits for so long after one of these (milliseconds).
const MOMENT = 20;
// However fast somebody types, it waits no longer (milliseconds).
const LONGEST = 100;

export class Precedence {
  #until = 0;
  #last = 0;

  constructor(isPlain: boolean) {
    if (!isPlain) return;
    const answer = (event: Event) => {
      // Whoever holds a key down looks at the picture.
      if (!(event instanceof KeyboardEvent && event.repeat)) this.#until = performance.now() + MOMENT;
    };
    for (const deed of DEEDS) addEventListener(deed, answer, { capture: true });
  }

  // Whether a picture that could be drawn now waits.
  waits(now: number): boolean {
    if (now < this.#until && now - this.#last < LONGEST) return true;
    this.#last = now;
    return false;
  }
}
