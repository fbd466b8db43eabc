// What the documentation says. Static text stands in docs/index.html, what is told of a request comes from the server.

export const version = (version: string) => `Version ${version}. For programs: `;

// What a request takes and answers.
export const REQUEST = {
  parameters: ["Parameter", "In", "Type", ""],
  members: ["Member", "", "Type", ""],
  required: "required",
  from: (least: number) => `from ${least}`,
  to: (most: number) => `to ${most}`,
  otherwise: "else",
  held: "What it holds",
  answered: ["Member", "Type", ""],
} as const;

// Where it is tried.
export const TRIED = {
  body: "Body",
  file: "File that is sent",
  noJson: (why: string) => `The body is no JSON: ${why}`,
  tryIt: "Try it",
  answer: "Answer",
  answered: (status: number) => `The server answered with ${status}.`,
  cut: (shown: string, all: string) => `… these were the first ${shown} of ${all} characters`,
  bytes: (count: string, kind: string) => `${count} bytes of ${kind}`,
} as const;
