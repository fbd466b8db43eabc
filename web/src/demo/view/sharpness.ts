// How sharp the picture is: as sharp as the screen while the machine keeps up, coarser while it moves and does not, and
// sharp again at rest.

// The coarsest, and one step (shares of the screen's pixels along a side).
const LEAST = 0.5;
const STEP = 0.75;
// Milliseconds from when a picture is wanted to when it can be drawn: more is too slow, less leaves room.
const SLOW = 40;
const QUICK = 20;
// Weight of the newest picture in the mean.
const NEWEST = 0.2;
// Pictures before a judgement.
const FEW = 6;
// A finer picture that proved too slow is not tried again for so long (milliseconds), and each time longer, up to a limit.
const PATIENCE = 4_000;
const LONGEST = 64_000;
// A page that is not seen draws nothing: what waited longer than this says nothing of the machine (milliseconds).
const UNSEEN = 1_000;

export class Sharpness {
  #share = 1;
  #mean = 0;
  #count = 0;
  #wait = PATIENCE;
  #finerAt = 0;

  // Where the processor draws, even the first picture is coarse: it comes sooner. A finer one is seldom tried there,
  // because what somebody does meanwhile has to wait for it.
  constructor(isPlain: boolean) {
    if (!isPlain) return;
    this.#share = LEAST;
    this.#wait = LONGEST;
    this.#finerAt = performance.now() + LONGEST;
  }

  // The share of the last picture.
  get last(): number {
    return this.#share;
  }

  // Share of the screen's pixels along a side, for a picture that is drawn now and was wanted before (milliseconds).
  share(wanted: number, now: number): number {
    const waited = now - wanted;
    if (waited > UNSEEN) return this.#share;
    this.#count += 1;
    this.#mean = this.#count === 1 ? waited : this.#mean + NEWEST * (waited - this.#mean);
    if (this.#count < FEW) return this.#share;
    if (this.#mean > SLOW && this.#share > LEAST) {
      this.#change(Math.max(LEAST, this.#share * STEP));
      this.#finerAt = now + this.#wait;
      this.#wait = Math.min(LONGEST, this.#wait * 2);
    } else if (this.#mean < QUICK && this.#share < 1 && now > this.#finerAt) {
      this.#change(Math.min(1, this.#share / STEP));
    }
    return this.#share;
  }

  #change(share: number): void {
    this.#share = share;
    this.#count = 0;
  }
}
