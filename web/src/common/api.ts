// The server's API: JSON in and out, problems as errors, a token where it is asked for.

import { h } from "./dom";

export const API = new URL("../api/v1/", location.href);

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

const TOKEN = "ngf-token";

// Asks for something; paths are relative to /api/v1/.
export async function ask<T>(path: string, method = "GET", body?: unknown, signal?: AbortSignal): Promise<T> {
  const answer = await send(path, method, body, {}, signal);
  if (answer.status === 204) return undefined as T;
  if (answer.headers.get("content-type")?.includes("json")) return (await answer.json()) as T;
  throw new Refused(noServer(`${answer.url} is not answered by ngf serve`));
}

// The same, for what is not JSON.
export async function send(
  path: string,
  method = "GET",
  body?: unknown,
  more: HeadersInit = {},
  signal?: AbortSignal,
): Promise<Response> {
  const token = sessionStorage.getItem(TOKEN);
  const headers = new Headers(more);
  if (token) headers.set("Authorization", `Bearer ${token}`);
  const isRaw = body instanceof Blob;
  if (body !== undefined && !isRaw) headers.set("Content-Type", "application/json");
  const sent = body === undefined || isRaw ? (body ?? null) : JSON.stringify(body);
  let answer: Response;
  try {
    answer = await fetch(new URL(path, API), { method, headers, body: sent, signal: signal ?? null });
  } catch (error) {
    throw new Refused(noServer(String(error)));
  }
  if (answer.status === 401) {
    await askForToken(token !== null);
    return send(path, method, body, more, signal);
  }
  if (answer.ok) return answer;
  if (answer.headers.get("content-type")?.includes("problem+json")) {
    throw new Refused((await answer.json()) as Problem);
  }
  throw new Refused(noServer(`${answer.url} answered ${answer.status}`));
}

// Nobody who does jobs answers.
export function noServer(why: string): Problem {
  return {
    status: 0,
    title: "No server",
    code: "no_server",
    detail: `There is no server that does jobs: ${why}.`,
    hint: "Start one with `ngf serve --data DIR` and open its address. The demo runs without any.",
  };
}

// Resolves once a token is there.
function askForToken(wasWrong: boolean): Promise<void> {
  return new Promise((resolve, reject) => {
    const input = h("input", { type: "password", autocomplete: "off", required: true, "aria-label": "Token" });
    const dialog = h(
      "dialog",
      { class: "token", "aria-label": "Token" },
      h("h2", {}, wasWrong ? "This token is not the server’s" : "This server asks for its token"),
      h("p", { class: "hint" }, "It stands in the file that the server was started with, and is kept until this tab is closed."),
      h("form", { method: "dialog" }, input, h("button", { class: "primary" }, "Go on")),
    );
    document.body.append(dialog);
    dialog.addEventListener("close", () => {
      dialog.remove();
      if (input.value === "") return reject(new Refused({ ...noServer(""), code: "no_token", detail: "Without the token nothing can be changed.", hint: "Ask whoever runs the server for it." }));
      sessionStorage.setItem(TOKEN, input.value);
      resolve();
    });
    dialog.showModal();
  });
}
