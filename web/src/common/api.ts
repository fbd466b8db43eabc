// The server's API: JSON in and out, problems as errors, a token where it is asked for.

import { h } from "./dom";
import { answered, NO_SERVER, TOKEN } from "./strings";

// The site may lie in any folder of its host: every page says where its root is.
export const API = new URL(`${document.documentElement.dataset["root"] ?? "."}/api/v1/`, location.href);

// Why the server refused (RFC 9457).
export interface Problem {
  status: number;
  title: string;
  detail: string;
  code: string;
  hint: string;
  errors?: { param: string; detail: string }[];
  request_id?: string;
}

export class Refused extends Error {
  readonly problem: Problem;

  constructor(problem: Problem) {
    super(problem.detail);
    this.problem = problem;
  }
}

export interface List<T> {
  data: T[];
  has_more: boolean;
}

const KEY = "ngf-token";

let wasRefused = false;

// Whether the server wants its token, as far as this tab knows.
export function isTokenWanted(): boolean {
  return wasRefused || sessionStorage.getItem(KEY) !== null;
}

export interface Manner {
  headers?: HeadersInit;
  signal?: AbortSignal;
  // A server that wants its token refuses; nobody is asked for it.
  isQuiet?: boolean;
}

// Asks for something; paths are relative to /api/v1/.
export async function ask<T>(path: string, method = "GET", body?: unknown, manner: Manner = {}): Promise<T> {
  const answer = await send(path, method, body, manner);
  if (answer.status === 204) return undefined as T;
  if (answer.headers.get("content-type")?.includes("json")) return (await answer.json()) as T;
  throw new Refused(noServer(NO_SERVER.otherAnswers(answer.url)));
}

// The same, for what is not JSON.
export async function send(path: string, method = "GET", body?: unknown, manner: Manner = {}): Promise<Response> {
  const token = sessionStorage.getItem(KEY);
  const headers = new Headers(manner.headers);
  if (token) headers.set("Authorization", `Bearer ${token}`);
  const isRaw = body instanceof Blob;
  if (body !== undefined && !isRaw) headers.set("Content-Type", "application/json");
  const sent = body === undefined || isRaw ? (body ?? null) : JSON.stringify(body);
  let answer: Response;
  try {
    // What is deleted as the page is left is deleted all the same.
    const keepalive = method === "DELETE";
    answer = await fetch(new URL(path, API), { method, headers, body: sent, signal: manner.signal ?? null, keepalive });
  } catch (error) {
    throw new Refused(noServer(String(error)));
  }
  wasRefused ||= answer.status === 401;
  if (answer.status === 401 && !manner.isQuiet) {
    await askForToken(token !== null);
    return send(path, method, body, manner);
  }
  if (answer.ok) return answer;
  if (answer.headers.get("content-type")?.includes("problem+json")) {
    throw new Refused((await answer.json()) as Problem);
  }
  throw new Refused(noServer(answered(answer.url, answer.status)));
}

// Nobody who does jobs answers.
export function noServer(why: string): Problem {
  const { title, detail, hint } = NO_SERVER;
  return { status: 0, title, code: "no_server", detail: detail(why), hint };
}

// The question for the token while it is asked: whoever else needs it waits for the same answer.
let asking: Promise<void> | null = null;
const GIVEN = "given";

// Resolves once a token is there.
function askForToken(wasWrong: boolean): Promise<void> {
  asking ??= dialogForToken(wasWrong).finally(() => (asking = null));
  return asking;
}

function dialogForToken(wasWrong: boolean): Promise<void> {
  return new Promise((resolve, reject) => {
    // Other characters no header takes.
    const pattern = { pattern: "[!-~]+", title: TOKEN.pattern };
    const input = h("input", { type: "password", autocomplete: "off", required: true, "aria-label": TOKEN.label, ...pattern });
    const dialog = h(
      "dialog",
      { class: "token", "aria-label": TOKEN.label },
      h("h2", {}, wasWrong ? TOKEN.wrong : TOKEN.asks),
      h("p", { class: "hint" }, TOKEN.hint),
      h(
        "form",
        { method: "dialog" },
        input,
        h("button", { class: "primary", value: GIVEN }, TOKEN.goOn),
        h("button", { formnovalidate: true }, TOKEN.cancel),
      ),
    );
    document.body.append(dialog);
    dialog.addEventListener("close", () => {
      dialog.remove();
      if (dialog.returnValue !== GIVEN) return reject(new Refused({ ...noServer(""), code: "no_token", ...TOKEN.missing }));
      sessionStorage.setItem(KEY, input.value);
      resolve();
    });
    dialog.showModal();
  });
}
