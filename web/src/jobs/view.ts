// What stands to the right of the list.

export interface View {
  readonly element: HTMLElement;
  // Nobody looks any more.
  close?(): void;
}
