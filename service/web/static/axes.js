// A card for each axis: made once, then its values are set.

import { attribute, className, el, text } from "./dom.js";
import { count, number, percent, span, unit, withDeviation } from "./format.js";

const HALF_WIDTH = 0.4; // the ends of the deviation bar, in shares of nominal
const LATE_S = 5;
const COLUMNS = [["Parameter", "unseen"], ["Nominal"], ["Estimate"], ["Deviation"], ["CUSUM"], ["Status", "unseen"]];
const STATUS_CLASS = { alarm: "pill bad", tracking: "pill good", "not tested": "pill untested" };

const cards = new Map(); // by id and shape of the axis

/** Shows the axes of an answer of /api/v1/axes. */
export function showAxes(axes) {
  const place = document.getElementById("axes");
  const shown = axes.map((axis) => {
    const key = JSON.stringify([axis.id, axis.parameters.map((p) => [p.name, p.unit, p.meaning])]);
    if (!cards.has(key)) cards.set(key, makeCard(axis));
    cards.get(key).show(axis);
    return cards.get(key).node;
  });
  if (shown.length === 0) shown.push(el("p", { className: "quiet" }, "No axis is configured."));
  if (shown.length !== place.children.length || shown.some((node, i) => place.children[i] !== node)) {
    place.replaceChildren(...shown);
  }
}

function makeCard(axis) {
  const age = el("p", { className: "age quiet" });
  const sub = el("p", { className: "sub quiet" });
  const title = el("h3", { id: `axis-${cards.size}` }, axis.id);
  const rows = axis.parameters.map(makeRow);
  const untested = el("ul", { className: "banner warn", "aria-label": `Not tested on ${axis.id}`, hidden: true });
  const node = el(
    "article",
    { className: "card", "aria-labelledby": title.id },
    el("div", { className: "head" }, title, age, sub),
    untested,
    el(
      "table",
      { role: "table", "aria-labelledby": title.id },
      el("thead", { role: "rowgroup" }, el("tr", { role: "row" }, ...COLUMNS.map(([name, kind]) => head(name, kind)))),
      el("tbody", { role: "rowgroup" }, ...rows.map((row) => row.node)),
    ),
    el("ul", { className: "trends", "data-axis": axis.id, "aria-label": `Long-term trend of ${axis.id}`, hidden: true }),
  );
  function show(now) {
    className(node, now.open_alarms.length > 0 ? "card alarmed" : "card");
    const seconds = now.last_sample_age_s;
    text(age, seconds === null ? "no sample yet" : `last sample ${span(seconds)} ago`);
    className(age, seconds === null || seconds > LATE_S ? "age late" : "age quiet");
    text(sub, describe(now));
    showSentences(untested, now.not_tested);
    now.parameters.forEach((parameter, i) => rows[i].show(parameter));
  }
  return { node, show };
}

/** Why parameters are not tested, and what would help: as long as there is any. */
function showSentences(list, sentences) {
  list.hidden = sentences.length === 0;
  const shown = [...list.children].map((item) => item.textContent);
  if (JSON.stringify(shown) !== JSON.stringify(sentences)) list.replaceChildren(...sentences.map((words) => el("li", {}, words)));
}

const signed = (x) => withDeviation(x, null, true);
/** NaN where the API says null: a value that is not a number. */
const deviationOf = (p) => (p.estimate === null || p.nominal === null ? NaN : p.estimate - p.nominal);
const head = (name, kind = "") => el("th", { role: "columnheader", scope: "col", className: kind }, name);
const sum = (counts) => Object.values(counts).reduce((a, b) => a + b, 0);

function describe(axis) {
  const used = (axis.counters.used ?? 0) + (axis.counters.seeding ?? 0);
  const lost = sum(axis.dropped);
  const parts = [`${axis.model.drive}, ${axis.model.output}`, `bus ${axis.bus}`, `${count(axis.samples)} samples`];
  if (axis.samples > used) parts.push(`${count(axis.samples - used)} not used`);
  if (lost > 0) parts.push(`${count(lost)} values dropped`);
  if (axis.epoch.words !== "") parts.push(axis.epoch.words);
  parts.push(...axis.outside_calibration.map((words) => `outside the calibration: ${words}`));
  if (axis.gated_by !== null) parts.push(`estimation paused: ${axis.gated_by}`);
  parts.push(...axis.detectors.map(detectorOf).filter((words) => words !== ""));
  return parts.join(" · ");
}

/** The detector that alarms, and the leading cause of the one in shadow mode once it has passed its threshold. */
function detectorOf(detector) {
  const name = detector.name === "multimodel" ? "multi-model detector" : "CUSUM tests";
  if (detector.alarms) return detector.name === "multimodel" ? `alarms by the ${name}` : "";
  return detector.leading !== null && detector.evidence > 1 ? `${name} (shadow mode): ${detector.leading}` : "";
}

function makeRow(parameter) {
  const cell = (label, ...children) => el("td", { role: "cell", "data-label": label }, ...children);
  const inUnit = unit(parameter.unit);
  const meaning = inUnit ? `${parameter.meaning}, ${inUnit}` : parameter.meaning;
  const nominal = el("span", { className: "nowrap" });
  const estimate = el("span", { className: "nowrap" });
  const share = el("span", { className: "percent" });
  const deviation = makeDeviation();
  const cusum = makeCusum(parameter.name);
  const status = el("span", { className: "pill" });
  const node = el(
    "tr",
    { role: "row" },
    el("th", { role: "rowheader", scope: "row" }, parameter.name, " ", el("small", {}, meaning)),
    cell("Nominal", nominal),
    cell("Estimate", estimate),
    cell("Deviation", share, deviation.node),
    cell("CUSUM", cusum.node),
    el("td", { role: "cell", className: "status" }, status),
  );
  function show(now) {
    const state = now.tested || now.status === "alarm" ? now.status : "not tested";
    const difference = deviationOf(now);
    text(nominal, number(now.nominal));
    text(estimate, withDeviation(now.estimate, now.standard_deviation));
    text(share, now.nominal ? percent(difference / Math.abs(now.nominal)) : `${signed(difference)} ${inUnit}`);
    text(status, state);
    className(status, STATUS_CLASS[state] ?? "pill");
    attribute(status, "title", now.not_tested_reason ?? "");
    className(node, { alarm: "out", "not tested": "untested" }[state] ?? "");
    deviation.show(now);
    cusum.show(now);
  }
  return { node, show };
}

function makeDeviation() {
  const [zone, band, tick] = ["zone", "band", "tick"].map((kind) => el("i", { className: kind }));
  const node = el("div", { className: "deviation", role: "img" }, zone, band, el("i", { className: "middle" }), tick);
  const spread = (part, from, to) => {
    part.style.left = `${100 * from}%`;
    part.style.width = `${100 * Math.max(0, to - from)}%`;
  };
  function show(p) {
    // A nominal value of zero has no percentage: then the bar is five tolerances wide on each side.
    const half = p.nominal ? HALF_WIDTH * Math.abs(p.nominal) : 5 * (p.tolerance || 1);
    const place = (d) => Math.min(1, Math.max(0, 0.5 + d / (2 * half)));
    const d = deviationOf(p);
    for (const part of [band, tick]) part.hidden = Number.isNaN(d);
    spread(zone, place(-p.tolerance), place(p.tolerance));
    if (Number.isNaN(d)) return attribute(node, "aria-label", "no estimate");
    spread(band, place(d - 2 * p.standard_deviation), place(d + 2 * p.standard_deviation));
    tick.style.left = `${100 * Math.min(0.985, Math.max(0.015, place(d)))}%`;
    const beyond = Math.abs(d) > p.tolerance ? "beyond" : "within";
    return attribute(node, "aria-label", `estimate ${beyond} the tolerated deviation of ${number(p.tolerance)}`);
  }
  return { node, show };
}

function makeCusum(name) {
  const meter = (direction) => el("div", { role: "meter", "aria-label": `CUSUM ${direction} of ${name}`, "aria-valuemin": 0 }, el("i"));
  const up = meter("up");
  const down = meter("down");
  const sign = (arrow) => el("span", { "aria-hidden": "true" }, arrow);
  const node = el("div", { className: "cusum" }, sign("▲"), up, sign("▼"), down);
  function set(bar, g, h) {
    const share = h > 0 ? Math.min(1, g / h) : 0;
    bar.firstChild.style.width = `${100 * share}%`;
    className(bar, share > 0.5 ? "high" : "");
    attribute(bar, "aria-valuemax", 100);
    attribute(bar, "aria-valuenow", Math.round(100 * share));
    attribute(bar, "title", `${number(g)} of ${number(h)}`);
  }
  function show(p) {
    set(up, p.cusum.up, p.threshold);
    set(down, p.cusum.down, p.threshold);
  }
  return { node, show };
}
