// Client of the server's API: JSON requests, RFC 9457 problems as errors, bearer token on demand.

import type { components } from "./api_types";
import { h } from "./dom";
import { httpStatus, NO_SERVER, TOKEN } from "./strings";

// The site can be served from any folder: each page states the relative path to its root in `data-root`.
export const API = new URL(`${document.documentElement.dataset["root"] ?? "."}/api/v1/`, location.href);

// Error body (RFC 9457). The page itself adds two codes: no server responds, and the user gave no token.
export type Problem = Omit<components["schemas"]["Problem"], "code" | "type"> & {
  code: components["schemas"]["ProblemCode"] | "no_server" | "no_token";
};

export class ApiError extends Error {
  readonly problem: Problem;

  constructor(problem: Problem) {
    super(problem.detail);
    this.problem = problem;
  }
}

// Page of a cursor-paginated list.
export interface List<T> {
  data: T[];
  has_more: boolean;
}

const TOKEN_KEY = "ngf-token";

let wasUnauthorized = false;

// Whether the server requires a token, as known to this tab.
export function isTokenRequired(): boolean {
  return wasUnauthorized || sessionStorage.getItem(TOKEN_KEY) !== null;
}

export interface RequestOptions {
  headers?: HeadersInit;
  signal?: AbortSignal;
  // Throw on 401 instead of showing the token dialog.
  skipTokenDialog?: boolean;
}

// Sends a request and returns its JSON body. Paths are relative to /api/v1/.
export async function requestJson<T>(path: string, method = "GET", body?: unknown, options: RequestOptions = {}): Promise<T> {
  const response = await request(path, method, body, options);
  if (response.status === 204) return undefined as T;
  if (response.headers.get("content-type")?.includes("json")) return (await response.json()) as T;
  throw new ApiError(noServer(NO_SERVER.otherServer(response.url)));
}

// Sends a request and returns the response, for bodies other than JSON.
export async function request(path: string, method = "GET", body?: unknown, options: RequestOptions = {}): Promise<Response> {
  const token = sessionStorage.getItem(TOKEN_KEY);
  const headers = new Headers(options.headers);
  if (token) headers.set("Authorization", `Bearer ${token}`);
  const isRaw = body instanceof Blob;
  if (body !== undefined && !isRaw) headers.set("Content-Type", "application/json");
  const payload = body === undefined || isRaw ? (body ?? null) : JSON.stringify(body);
  let response: Response;
  try {
    // A deletion is sent even while the page is being closed.
    const keepalive = method === "DELETE";
    const signal = options.signal ?? null;
    response = await fetch(new URL(path, API), { method, headers, body: payload, signal, keepalive });
  } catch (error) {
    throw new ApiError(noServer(String(error)));
  }
  wasUnauthorized ||= response.status === 401;
  if (response.status === 401 && !options.skipTokenDialog) {
    await requestToken(token !== null);
    return request(path, method, body, options);
  }
  if (response.ok) return response;
  if (response.headers.get("content-type")?.includes("problem+json")) {
    throw new ApiError((await response.json()) as Problem);
  }
  throw new ApiError(noServer(httpStatus(response.url, response.status)));
}

// Problem for a page without a reachable job server.
export function noServer(reason: string): Problem {
  const { title, detail, hint } = NO_SERVER;
  return { status: 0, title, code: "no_server", detail: detail(reason), hint };
}

// Open token dialog, shared by all requests that need the token.
let openDialog: Promise<void> | null = null;
const SUBMITTED = "submitted";

// Resolves once the user has entered a token.
function requestToken(wasWrong: boolean): Promise<void> {
  openDialog ??= showTokenDialog(wasWrong).finally(() => (openDialog = null));
  return openDialog;
}

function showTokenDialog(wasWrong: boolean): Promise<void> {
  return new Promise((resolve, reject) => {
    // Printable ASCII without spaces: other characters are invalid in a header.
    const pattern = { pattern: "[!-~]+", title: TOKEN.pattern };
    const input = h("input", { type: "password", autocomplete: "off", required: true, "aria-label": TOKEN.label, ...pattern });
    const dialog = h(
      "dialog",
      { class: "token", "aria-label": TOKEN.label },
      h("h2", {}, wasWrong ? TOKEN.wrong : TOKEN.required),
      h("p", { class: "hint" }, TOKEN.hint),
      h(
        "form",
        { method: "dialog" },
        input,
        h("button", { class: "primary", value: SUBMITTED }, TOKEN.submit),
        h("button", { formnovalidate: true }, TOKEN.cancel),
      ),
    );
    document.body.append(dialog);
    dialog.addEventListener("close", () => {
      dialog.remove();
      if (dialog.returnValue !== SUBMITTED) {
        return reject(new ApiError({ ...noServer(""), code: "no_token", ...TOKEN.missing }));
      }
      sessionStorage.setItem(TOKEN_KEY, input.value);
      resolve();
    });
    dialog.showModal();
  });
}
