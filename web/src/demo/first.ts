// The engine takes longest to come, so that the first worker is begun before the page itself is read. What it says
// meanwhile is kept.

let early: { worker: Worker; said: Event[] } | null = null;

export function beginEarly(): void {
  const worker = begin();
  const said: Event[] = [];
  worker.onmessage = worker.onerror = (event: Event) => said.push(event);
  early = { worker, said };
}

// The worker that was begun early, if nobody has it yet, or else a new one.
export function takeWorker(heard: (event: MessageEvent) => void, failed: (event: ErrorEvent) => void): Worker {
  const { worker, said } = early ?? { worker: begin(), said: [] };
  early = null;
  const tell = (event: Event) => (event instanceof MessageEvent ? heard(event) : failed(event as ErrorEvent));
  worker.onmessage = worker.onerror = tell;
  // Whoever takes it first finishes what it is at.
  queueMicrotask(() => said.forEach(tell));
  return worker;
}

function begin(): Worker {
  return new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
}
