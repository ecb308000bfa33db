// The alarm table: the active ones first, then the last ones that have ended.

import { el, text } from "./dom.js";
import { count, moment, percent, span, unit, withDeviation } from "./format.js";

let shown = null;
let announced = null; // of the active alarms that have been read out: stage and name by id

/** Shows two answers of /api/v1/alarms: those that are active and those that have ended. */
export function showAlarms(active, ended) {
  announce(active.alarms);
  const alarms = [...active.alarms, ...ended.alarms];
  const key = JSON.stringify([alarms, active.total, ended.total, new Date().toDateString()]);
  if (key === shown) return;
  shown = key;
  const table = document.getElementById("alarm-table");
  table.hidden = alarms.length === 0;
  table.tBodies[0].replaceChildren(...alarms.map(row));
  const more = active.total + ended.total - alarms.length;
  const note = document.getElementById("alarm-note");
  note.hidden = alarms.length > 0 && more === 0;
  text(note, alarms.length === 0 ? "No alarm has been raised." : `${count(more)} more: see /api/v1/alarms.`);
}

function row(alarm) {
  const cell = (label, ...children) => el("td", { role: "cell", "data-label": label }, ...children);
  const arrow = alarm.direction === "up" ? "▲" : "▼";
  const said = el("small", { className: "words" }, alarm.words);
  const parameter = cell("Parameter", el("b", {}, alarm.parameter), ` ${arrow} ${alarm.direction}`, ...namesOf(alarm), said);
  return el(
    "tr",
    { role: "row", className: alarm.active ? "active" : "ended" },
    cell("State", el("span", { className: alarm.active ? "pill bad" : "pill" }, alarm.active ? "active" : "ended")),
    cell("Axis", alarm.axis),
    parameter,
    cell("Size", sizeOf(alarm)),
    cell("Onset", time(alarm.onset), ...withinOf(alarm)),
    cell("Raised", time(alarm.raised)),
    cell("Ended", alarm.ended === null ? "–" : time(alarm.ended)),
  );
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

function announce(active) {
  const nameOf = (alarm) => `${alarm.stage} ${alarm.parameter}`;
  const fresh = active.filter((alarm) => announced !== null && announced.get(alarm.id) !== nameOf(alarm));
  const news = fresh.map((alarm) => `${announced.has(alarm.id) ? "Alarm" : "New alarm"}: ${alarm.axis}: ${alarm.words}`);
  announced = new Map(active.map((alarm) => [alarm.id, nameOf(alarm)]));
  if (news.length > 0) text(document.getElementById("news"), news.join("; "));
}
