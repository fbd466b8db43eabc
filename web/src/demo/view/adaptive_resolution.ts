// Adaptive resolution: full while frames are fast enough, reduced during slow motion, full again at rest.

// Minimum resolution and factor per step (fractions of the screen's resolution per axis).
const MIN_FRACTION = 0.5;
const STEP = 0.75;
// Mean latency from request to rendering of a frame above which the resolution is reduced, and below which it
// is increased (ms).
const SLOW_MS = 40;
const FAST_MS = 20;
// Weight of the newest frame in the exponential mean.
const SMOOTHING = 0.2;
// Frames between changes.
const MIN_FRAMES = 6;
// Time until a resolution that was too slow is tried again; it doubles up to the maximum (ms).
const RETRY_MS = 4_000;
const MAX_RETRY_MS = 64_000;
// Longer latencies are ignored: the page was hidden (ms).
const HIDDEN_MS = 1_000;

export class AdaptiveResolution {
  #fraction = 1;
  #mean = 0;
  #count = 0;
  #retryMs = RETRY_MS;
  #increaseAfter = 0;

  // Software rendering starts at the minimum, so that the first frame appears sooner. It rarely tries a
  // higher resolution, because input waits for each frame.
  constructor(isSoftware: boolean) {
    if (!isSoftware) return;
    this.#fraction = MIN_FRACTION;
    this.#retryMs = MAX_RETRY_MS;
    this.#increaseAfter = performance.now() + MAX_RETRY_MS;
  }

  // Resolution of the last frame.
  get current(): number {
    return this.#fraction;
  }

  // Resolution for a frame that was requested earlier and is rendered now (ms).
  update(requested: number, now: number): number {
    const latency = now - requested;
    if (latency > HIDDEN_MS) return this.#fraction;
    this.#count += 1;
    this.#mean = this.#count === 1 ? latency : this.#mean + SMOOTHING * (latency - this.#mean);
    if (this.#count < MIN_FRAMES) return this.#fraction;
    if (this.#mean > SLOW_MS && this.#fraction > MIN_FRACTION) {
      this.#change(Math.max(MIN_FRACTION, this.#fraction * STEP));
      this.#increaseAfter = now + this.#retryMs;
      this.#retryMs = Math.min(MAX_RETRY_MS, this.#retryMs * 2);
    } else if (this.#mean < FAST_MS && this.#fraction < 1 && now > this.#increaseAfter) {
      this.#change(Math.min(1, this.#fraction / STEP));
    }
    return this.#fraction;
  }

  #change(fraction: number): void {
    this.#fraction = fraction;
    this.#count = 0;
  }
}
