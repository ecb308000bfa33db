// The long-term trend of each parameter below its axis: a sentence, and a plot of the last weeks.

import { el, text } from "./dom.js";

const EVERY_MS = 60000;
const POINTS = 120;
const [WIDTH, HEIGHT] = [120, 28];
const asked = new Map(); // when, by axis

/** Fetches and shows the long-term trends of the visible axes, once a minute. */
export async function showTrends(axes, ask) {
  for (const { id } of axes) {
    if (Date.now() - (asked.get(id) ?? -Infinity) < EVERY_MS) continue;
    asked.set(id, Date.now());
    const trend = await ask(`/api/v1/axes/${encodeURIComponent(id)}/trend?points=${POINTS}`);
    const place = [...document.querySelectorAll(".trends")].find((node) => node.dataset.axis === id);
    const shown = trend.parameters.filter((p) => p.drift !== null);
    if (!place) continue;
    place.hidden = shown.length === 0;
    place.replaceChildren(...shown.map(row));
  }
}

function row(p) {
  const words = el("span", {});
  text(words, [p.words, ...p.limits.map((limit) => limit.words)].join("; "));
  return el("li", {}, picture(p), words);
}

/** Plot of the means over time, with the nominal value as a line. */
function picture(p) {
  const times = p.time.map((t) => Date.parse(t));
  const [low, high] = [Math.min(...p.mean, p.nominal), Math.max(...p.mean, p.nominal)];
  const span = times.at(-1) - times[0] || 1;
  const x = (t) => (WIDTH * (t - times[0])) / span;
  const y = (v) => HEIGHT - 2 - ((HEIGHT - 4) * (v - low)) / (high - low || 1);
  const line = p.mean.map((v, i) => `${x(times[i]).toFixed(1)},${y(v).toFixed(1)}`).join(" ");
  const nominal = svg("line", { class: "nominal", x1: 0, x2: WIDTH, y1: y(p.nominal), y2: y(p.nominal) });
  const label = `${p.name} over its long-term history, and its nominal value`;
  return svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label }, nominal, svg("polyline", { points: line }));
}

function svg(tag, attributes, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
