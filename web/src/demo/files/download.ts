// Downloads bytes as a file.

import { h } from "../../common/dom";

export function download(name: string, bytes: Blob): void {
  const url = URL.createObjectURL(bytes);
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
