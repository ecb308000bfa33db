// The alarm table: the active ones first, then the last ones that have ended.

import { buttons } from "./alarm_actions.js";
import { el, text } from "./dom.js";
import { hasToken } from "./token.js";
import { count, moment, percent, span, unit, withDeviation } from "./format.js";

let shown = null;
let announced = null; // of the active alarms that have been read out: stage and name by key

/** Shows two answers of /api/v1/alarms: those that are active and those that have ended; `refresh` asks for new ones. */
export function showAlarms(active, ended, refresh) {
  announce(active.alarms);
  const alarms = [...active.alarms, ...ended.alarms];
  const key = JSON.stringify([alarms, active.total, ended.total, new Date().toDateString()]);
  if (key === shown) return;
  shown = key;
  const table = document.getElementById("alarm-table");
  table.hidden = alarms.length === 0;
  table.tBodies[0].replaceChildren(...alarms.map((alarm) => row(alarm, refresh)));
  const more = active.total + ended.total - alarms.length;
  const note = document.getElementById("alarm-note");
  note.hidden = alarms.length > 0 && more === 0;
  text(note, alarms.length === 0 ? "No alarm has been raised." : `${count(more)} more: see /api/v1/alarms.`);
}

function row(alarm, refresh) {
  const cell = (label, ...children) => el("td", { role: "cell", "data-label": label }, ...children);
  const arrow = alarm.direction === "up" ? "▲" : "▼";
  const said = el("small", { className: "words" }, alarm.words);
  const parameter = cell("Parameter", el("b", {}, alarm.parameter), ` ${arrow} ${alarm.direction}`, ...namesOf(alarm), said);
  return el(
    "tr",
    { role: "row", className: alarm.active ? "active" : "ended" },
    cell("State", ...stateOf(alarm)),
    cell("Axis", alarm.axis),
    parameter,
    cell("Size", sizeOf(alarm)),
    cell("Onset", time(alarm.onset), ...withinOf(alarm)),
    cell("Raised", time(alarm.raised)),
    cell("Ended", alarm.ended === null ? "–" : time(alarm.ended)),
    cell("Action", ...buttons(alarm, refresh)),
  );
}

const isHidden = (alarm) => ["shelved", "suppressed", "out-of-service"].includes(alarm.state);

/** Whether it is active, what a person has done about it, its priority, and whether the journal has it. */
function stateOf(alarm) {
  const urgent = alarm.active && !isHidden(alarm) ? " bad" : "";
  const found = [el("span", { className: `pill${urgent}` }, alarm.active ? "active" : "ended")];
  if (!alarm.recorded) found.push(" ", el("span", { className: "pill warn" }, "not yet recorded"));
  const until = alarm.shelved_until === null ? "" : ` until ${moment(alarm.shelved_until)}`;
  const state = alarm.state === "normal" ? [] : [alarm.state === "returned" ? "unacknowledged" : alarm.state + until];
  found.push(el("small", { className: "words" }, [...state, `${alarm.priority} priority`].join(", ")));
  if (alarm.recording !== null) found.push(el("small", { className: "words" }, framesOf(alarm)));
  if (alarm.work_order !== null) found.push(el("small", { className: "words" }, `work order ${alarm.work_order}`));
  return found;
}

/** The raw frames around it, to download; a link sends no token, so with one it is only named. */
function framesOf(alarm) {
  if (hasToken()) return `frames: ${alarm.recording}`;
  return el("a", { href: `/api/v1/recordings/${encodeURIComponent(alarm.recording)}`, download: alarm.recording }, "frames");
}

/** That it has no name yet, or what it was called before it had this one. */
function namesOf(alarm) {
  if (alarm.stage === "changed") return alarm.active ? [el("span", { className: "quiet" }, " not yet named")] : [];
  const before = [...new Set(alarm.past.map((name) => name.parameter))].filter((name) => name !== alarm.parameter);
  return before.length === 0 ? [] : [el("span", { className: "quiet" }, ` at first ${before.join(", ")}`)];
}

/** How far the ends of the interval in which the onset lies are from it, as far as they are known. */
function withinOf(alarm) {
  const away = (end) => span(Math.abs(Date.parse(end) - Date.parse(alarm.onset)) / 1000);
  const ends = [["−", alarm.onset_low], ["+", alarm.onset_high]].filter(([, end]) => end !== null);
  if (ends.length === 0) return [];
  const [low, high] = [alarm.onset_low, alarm.onset_high].map((end) => (end === null ? "unknown" : moment(end)));
  const title = `from ${low} to ${high} with a probability of 90 %`;
  return [el("small", { className: "words", title }, ends.map(([sign, end]) => `${sign}${away(end)}`).join(" "))];
}

const shareOf = (alarm) => (alarm.nominal ? ` (${percent(alarm.size / Math.abs(alarm.nominal))})` : "");
const sizeOf = (alarm) => alarm.size === null ? (alarm.active ? "not known" : "–") : `${withDeviation(alarm.size, alarm.size_sd, true)} ${unit(alarm.unit)}${shareOf(alarm)}`;

const time = (iso) => el("time", { dateTime: iso, title: iso, className: "nowrap" }, moment(iso));

/** Of an alarm, before and after it is recorded and whatever its name becomes. */
const keyOf = (alarm) => `${alarm.axis} ${alarm.raised} ${(alarm.past[0] ?? alarm).parameter}`;

function announce(alarms) {
  const active = alarms.filter((alarm) => !isHidden(alarm));
  const nameOf = (alarm) => `${alarm.stage} ${alarm.parameter}`;
  const fresh = active.filter((alarm) => announced !== null && announced.get(keyOf(alarm)) !== nameOf(alarm));
  const news = fresh.map((alarm) => `${announced.has(keyOf(alarm)) ? "Alarm" : "New alarm"}: ${alarm.axis}: ${alarm.words}`);
  announced = new Map(active.map((alarm) => [keyOf(alarm), nameOf(alarm)]));
  if (news.length > 0) text(document.getElementById("news"), news.join("; "));
}
