// Asks the API, with the token of this tab where the daemon wants one; a form asks for it.

import { el, text } from "./dom.js";

const PATIENCE_MS = 4000;
const KEY = "axiswatch-token";
let form = null;

/** The daemon wants a token, and has none, or one that is not valid. */
export class TokenNeeded extends Error {}

/** The body of an answer; with a body of its own, the request is a POST. Where a token is needed, the form comes up. */
export async function ask(path, body = null) {
  const token = sessionStorage.getItem(KEY);
  const headers = token === null ? {} : { Authorization: `Bearer ${token}` };
  const request = { signal: AbortSignal.timeout(PATIENCE_MS), cache: "no-store", headers };
  if (body !== null) {
    headers["Content-Type"] = "application/json";
    Object.assign(request, { method: "POST", body: JSON.stringify(body) });
  }
  const answer = await fetch(path, request);
  const found = await answer.json();
  if (answer.status === 401) {
    showForm(found.detail);
    throw new TokenNeeded(found.detail);
  }
  if (!answer.ok) throw new Error(typeof found.detail === "string" ? found.detail : `status ${answer.status}`);
  form?.remove();
  form = null;
  return found;
}

export const hasToken = () => sessionStorage.getItem(KEY) !== null;

/**
 * Lets the links to reports work, which send no header: a cookie for /reports only, where nothing can be changed, for an
 * hour from the last call. Lax: reports are sandboxed, and link to each other.
 */
export function allowReports() {
  const secure = location.protocol === "https:" ? "; secure" : "";
  if (hasToken()) document.cookie = `${KEY}=${sessionStorage.getItem(KEY)}; path=/reports/; max-age=3600; samesite=lax${secure}`;
}

function showForm(why) {
  if (form !== null) return text(form.querySelector("p"), why);
  const field = el("input", { type: "password", id: "token", autocomplete: "off", required: true, pattern: "[A-Za-z0-9_\\-]+" });
  const label = el("label", { htmlFor: "token" }, "Token");
  form = el("form", { id: "sign-in", className: "banner note" }, el("p", { role: "status" }, why), label, field, el("button", {}, "Use"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    // This tab keeps it, and no other; it is gone when the tab is closed.
    sessionStorage.setItem(KEY, field.value);
    location.reload();
  });
  document.querySelector("header").append(form);
  return field.focus();
}
