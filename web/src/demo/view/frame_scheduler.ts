// With software rendering a frame blocks input, so frames are deferred shortly after input events.

const INPUT_EVENTS = ["keydown", "keyup", "pointerdown", "pointerup"];
// Delay of a frame after an input event (ms).
const INPUT_DELAY_MS = 20;
// Maximum time between frames during continuous input (ms).
const MAX_DEFERRAL_MS = 100;

export class FrameScheduler {
  #deferUntil = 0;
  #lastFrame = 0;

  constructor(isSoftware: boolean) {
    if (!isSoftware) return;
    const onInput = (event: Event) => {
      // A held key moves the camera or the object, so its frames are not deferred.
      if (!(event instanceof KeyboardEvent && event.repeat)) this.#deferUntil = performance.now() + INPUT_DELAY_MS;
    };
    for (const type of INPUT_EVENTS) addEventListener(type, onInput, { capture: true });
  }

  // Whether a frame that could be rendered now is deferred.
  shouldDefer(now: number): boolean {
    if (now < this.#deferUntil && now - this.#lastFrame < MAX_DEFERRAL_MS) return true;
    this.#lastFrame = now;
    return false;
  }
}
