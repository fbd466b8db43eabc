// Texts that all pages share. Static text is in each page's index.html.

export const COPY_AS_CURL = "Copy as curl";
export const RELOAD = "Reload the page. If the error persists, report it.";

export const outOf = (part: string | number, whole: string | number) => `${part} of ${whole}`;
export const httpStatus = (url: string, status: number) => `${url} returned HTTP ${status}`;

export const NO_SERVER = {
  title: "No server",
  detail: (reason: string) => `No job server reachable: ${reason}.`,
  hint: "Start one with `ngf serve --data-dir DIR` and open its URL. The demo works without a server.",
  staticHost: "this page is served as static files",
  otherServer: (url: string) => `the response of ${url} is not from ngf serve`,
} as const;

// Token dialog.
export const TOKEN = {
  label: "Token",
  required: "This server requires a token",
  wrong: "Wrong token",
  hint: "The token is in the file that was passed to `ngf serve --token-file`. It is stored until this tab is closed.",
  submit: "Continue",
  cancel: "Cancel",
  pattern: "Letters, digits and punctuation, without spaces",
  missing: { detail: "Write requests need the token.", hint: "Ask the administrator of the server for it." },
} as const;

// Copied shell command.
export const COMMAND = {
  copied: "Copied.",
  selected: "Selected: this browser does not allow copying here. Press Ctrl+C or ⌘C.",
  token: "Replace $TOKEN with the server’s token.",
} as const;
