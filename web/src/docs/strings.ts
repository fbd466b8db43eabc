// Texts of the API page. Static text is in docs/index.html; descriptions of requests come from the server.

export const version = (version: string) => `Version ${version}. OpenAPI description: `;

// Reference of a request.
export const REQUEST = {
  parameters: ["Parameter", "In", "Type", "Description"],
  members: ["Member", "", "Type", "Description"],
  required: "required",
  min: (value: number) => `≥ ${value}`,
  max: (value: number) => `≤ ${value}`,
  otherStatus: "default",
  schema: "Schema",
  responseMembers: ["Member", "Type", "Description"],
} as const;

// Console of a request.
export const CONSOLE = {
  body: "Request body",
  file: "File to upload",
  invalidJson: (reason: string) => `The body is not valid JSON: ${reason}`,
  send: "Try it",
  response: "Response",
  status: (status: number) => `The server returned HTTP ${status}.`,
  truncated: (shown: string, total: string) => `… first ${shown} of ${total} characters`,
  bytes: (count: string, type: string) => `${count} bytes of ${type}`,
} as const;
