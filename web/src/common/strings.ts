// What the pages say in common. Static text stands in the index.html of each.

export const COPY_AS_CURL = "Copy as curl";
export const RELOAD = "Reload the page; if it happens again, report it.";

export const outOf = (part: string | number, whole: string | number) => `${part} of ${whole}`;
export const answered = (url: string, status: number) => `${url} answered ${status}`;

// Nobody who does jobs answers.
export const NO_SERVER = {
  title: "No server",
  detail: (why: string) => `There is no server that does jobs: ${why}.`,
  hint: "Start one with `ngf serve --data DIR` and open its address. The demo runs without any.",
  behindNone: "none is behind this page",
  otherAnswers: (url: string) => `${url} is not answered by ngf serve`,
} as const;

// The question for the token.
export const TOKEN = {
  label: "Token",
  asks: "This server asks for its token",
  wrong: "This token is not the server’s",
  hint: "It stands in the file that the server was started with, and is kept until this tab is closed.",
  goOn: "Go on",
  cancel: "Cancel",
  pattern: "Letters, digits and signs, without spaces",
  missing: { detail: "Without the token nothing can be changed.", hint: "Ask whoever runs the server for it." },
} as const;

// A command for a shell.
export const COMMAND = {
  copied: "Copied.",
  selected: "Selected: this browser lets no page copy here. Press Ctrl+C, or ⌘C.",
  token: "$TOKEN stands for the server’s token.",
} as const;
