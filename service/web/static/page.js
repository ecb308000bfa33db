// Polls the daemon once a second and shows its answers, or since when there are none.

import { showAlarms } from "./alarms.js";
import { showAxes } from "./axes.js";
import { className, list, text } from "./dom.js";
import { moment, span, zone } from "./format.js";
import { allowReports, ask, hasToken, TokenNeeded } from "./token.js";
import { showTrends } from "./trends.js";

const EVERY_MS = 1000;
const PATHS = [
  "/api/v1/service",
  "/api/v1/axes",
  "/api/v1/alarms?active=true&limit=100",
  "/api/v1/alarms?active=false&limit=20",
];

const by = (id) => document.getElementById(id);
let answered = null; // time of the last answer
let lostSince = null;

async function refresh() {
  try {
    const [service, axes, active, ended] = await Promise.all(PATHS.map((path) => ask(path)));
    answered = new Date();
    lostSince = null;
    showService(service, active.total);
    showAxes(axes.axes);
    showAlarms(active, ended, refresh);
    await showTrends(axes.axes, ask);
  } catch (error) {
    if (error instanceof TokenNeeded) return showLocked();
    lostSince ??= new Date();
    showLost(error);
  }
}

function showService(service, alarms) {
  document.body.classList.remove("stale");
  by("lost").hidden = true;
  const state = by("state");
  text(state, service.ready ? "ready" : "not ready");
  className(state, service.ready ? "pill good" : "pill warn");
  list(by("reasons"), service.reasons);
  list(by("messages"), service.messages);
  text(by("insecure"), service.insecure ?? "");
  by("insecure").hidden = service.insecure === null;
  by("report").hidden = service.report === null;
  by("metrics").hidden = hasToken(); // a link sends no token
  if (service.report !== null) allowReports();
  const running = span((new Date(service.taken) - new Date(service.started)) / 1000);
  text(by("about"), `version ${service.version}, running for ${running}`);
  document.title = alarms ? `(${alarms}) axiswatch` : "axiswatch";
}

function showLocked() {
  document.body.classList.add("stale");
  className(by("state"), "pill warn");
  text(by("state"), "token needed");
  for (const id of ["lost", "reasons"]) by(id).hidden = true;
  document.title = "token needed – axiswatch";
}

function showLost(error) {
  document.body.classList.add("stale");
  className(by("state"), "pill bad");
  text(by("state"), "no answer");
  by("lost").hidden = false;
  by("reasons").hidden = true;
  const since = `No answer since ${moment(answered ?? lostSince)}`;
  const why = error instanceof TypeError || error.name === "TimeoutError" ? "" : ` (${error.message})`;
  text(by("lost"), `${since}${why}. ${answered ? "The values below are from that time." : ""}`);
  document.title = "no answer – axiswatch";
}

async function watch() {
  // A page in the background does not poll; it updates as soon as it is visible.
  if (!document.hidden) await refresh();
  setTimeout(watch, EVERY_MS);
}

text(by("zone"), `Times are in the time zone of this browser (${zone()}); the API uses UTC.`);
watch();
