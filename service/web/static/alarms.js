// The alarm table: the active ones first, then the last ones that have ended.

import { el, text } from "./dom.js";
import { count, moment, percent, unit, withDeviation } from "./format.js";

let shown = null;
let announced = null; // ids of the active alarms that have been read out

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
  const parameter = cell("Parameter", el("b", {}, alarm.parameter), ` ${arrow} ${alarm.direction}`, said);
  return el(
    "tr",
    { role: "row", className: alarm.active ? "active" : "ended" },
    cell("State", el("span", { className: alarm.active ? "pill bad" : "pill" }, alarm.active ? "active" : "ended")),
    cell("Axis", alarm.axis),
    parameter,
    cell("Size", sizeOf(alarm)),
    cell("Onset", time(alarm.onset)),
    cell("Raised", time(alarm.raised)),
    cell("Ended", alarm.ended === null ? "–" : time(alarm.ended)),
  );
}

const shareOf = (alarm) => (alarm.nominal ? ` (${percent(alarm.size / Math.abs(alarm.nominal))})` : "");
const sizeOf = (alarm) => `${withDeviation(alarm.size, alarm.size_sd, true)} ${unit(alarm.unit)}${shareOf(alarm)}`;

const time = (iso) => el("time", { dateTime: iso, title: iso, className: "nowrap" }, moment(iso));

function announce(active) {
  const fresh = active.filter((alarm) => announced !== null && !announced.has(alarm.id));
  announced = new Set(active.map((alarm) => alarm.id));
  if (fresh.length === 0) return;
  const words = fresh.map((alarm) => `${alarm.axis}: ${alarm.words}`);
  text(document.getElementById("news"), `New alarm: ${words.join("; ")}`);
}
