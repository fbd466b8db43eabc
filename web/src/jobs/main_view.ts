// Main view, to the right of the job list.

export interface View {
  readonly element: HTMLElement;
  // Releases listeners and timers when another view replaces this one.
  close?(): void;
  // Repeats a request that has failed: the server is reachable again, or the user opens the view again.
  retry?(): void;
}
