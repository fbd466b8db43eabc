// Early start of the first worker. The wasm module takes longest to load, so its worker starts before the
// page's modules are loaded. Its events are buffered until a client acquires the worker.

let early: { worker: Worker; buffered: Event[] } | null = null;

export function startEarly(): void {
  const worker = createWorker();
  const buffered: Event[] = [];
  worker.onmessage = worker.onerror = (event: Event) => buffered.push(event);
  early = { worker, buffered };
}

// Returns the early worker if it is still available, otherwise a new one.
export function acquireWorker(onMessage: (event: MessageEvent) => void, onError: (event: ErrorEvent) => void): Worker {
  const { worker, buffered } = early ?? { worker: createWorker(), buffered: [] };
  early = null;
  const dispatch = (event: Event) => (event instanceof MessageEvent ? onMessage(event) : onError(event as ErrorEvent));
  worker.onmessage = worker.onerror = dispatch;
  // The caller finishes its constructor before it receives the buffered events.
  queueMicrotask(() => buffered.forEach(dispatch));
  return worker;
}

function createWorker(): Worker {
  return new Worker(new URL("./worker_entry.ts", import.meta.url), { type: "module" });
}
