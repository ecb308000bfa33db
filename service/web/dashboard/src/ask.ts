// Requests to the daemon, with the token of this tab if the daemon requires one.
import type { components } from "./schema";

export type Body<K extends keyof components["schemas"]> = components["schemas"][K];
export type Axis = Body<"Axis">;
export type Parameter = Body<"Parameter">;
export type Alarm = Body<"Alarm">;
export type AlarmRecord = Body<"AlarmRecord">;
export type Service = Body<"Service">;

const PATIENCE_MS = 4000;
// The longest time that the daemon may take (gate.py): after an earlier time-out users would repeat a finished action.
const PATIENCE_WRITING_MS = 130_000;
const KEY = "axiswatch-token";

/** The daemon has refused a request; the reason as a text and, if it has a kind, as values. */
export class Refused extends Error {
  constructor(detail: string, readonly sentences: Body<"Sentence">[]) {
    super(detail);
  }
}

/** The daemon requires a token, and there is none or an invalid one. */
export class TokenNeeded extends Refused {}

export const hasToken = (): boolean => sessionStorage.getItem(KEY) !== null;

/** Only this tab keeps the token; it is gone when the tab is closed. */
export const keepToken = (token: string): void => sessionStorage.setItem(KEY, token);

/** Headers of a request: the token, if there is one. */
export function authorization(): Record<string, string> {
  const token = sessionStorage.getItem(KEY);
  return token === null ? {} : { Authorization: `Bearer ${token}` };
}

/** The body of an answer; if a body is given, the request is a POST. */
export async function ask<T>(path: string, body: unknown = null, patienceMs = body === null ? PATIENCE_MS : PATIENCE_WRITING_MS): Promise<T> {
  const headers = authorization();
  const request: RequestInit = { signal: AbortSignal.timeout(patienceMs), cache: "no-store", headers };
  if (body !== null) {
    headers["Content-Type"] = "application/json";
    Object.assign(request, { method: "POST", body: JSON.stringify(body) });
  }
  const answer = await fetch(path, request);
  const found = await answer.json();
  if (answer.status === 401) throw new TokenNeeded(found.detail, found.sentences ?? []);
  if (!answer.ok) throw new Refused(typeof found.detail === "string" ? found.detail : `status ${answer.status}`, found.sentences ?? []);
  return found as T;
}

/** Whether a request got no answer at all. */
export const isSilence = (error: unknown): boolean =>
  error instanceof TypeError || (error instanceof Error && error.name === "TimeoutError");

/** Saves a file of the API: a link sends no token, so that the page fetches it. */
export async function download(path: string, name: string): Promise<void> {
  const answer = await fetch(path, { headers: authorization(), cache: "no-store" });
  if (!answer.ok) throw new Error(`status ${answer.status}`);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await answer.blob());
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/**
 * Makes links to reports work, which send no header: a cookie for /reports only, where nothing can be changed, for an
 * hour from the last call. Lax: reports are sandboxed, and link to each other.
 */
export function allowReports(): void {
  const secure = location.protocol === "https:" ? "; secure" : "";
  if (hasToken()) document.cookie = `${KEY}=${sessionStorage.getItem(KEY)}; path=/reports/; max-age=3600; samesite=lax${secure}`;
}
