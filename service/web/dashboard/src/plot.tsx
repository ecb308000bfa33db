// A plot over time or frequency: lines with a band, alarms as marks. All plots over time that have `onRange` share one
// range, which each of them can change.
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { local, ticks as tickTexts, two } from "./format";
import type { Sign } from "./resonances";
import type { Mark } from "./series";
import { language } from "./language";

export type Range = [number, number];

export interface Line {
  /** A colour of the style sheet. */
  colour: string;
  dash?: number[];
  width?: number;
  /** Points without connecting lines. */
  points?: boolean;
}

export interface PlotProps {
  label: string;
  height: number;
  /** Quantity along the plot: times [s since 1970], or frequencies [Hz] on a logarithmic axis. */
  kind?: "time" | "frequency";
  time: number[];
  columns: (number | null)[][];
  lines: Line[];
  /** Numbers of two columns between which a band is drawn. */
  band?: [number, number];
  marks?: Mark[];
  /** Times of changes of the nominal values, drawn as lines. */
  changes?: number[];
  /** Positions along the plot, each with its mark at the top. */
  signs?: Sign[];
  range: Range;
  /** The range of the values. */
  scale: Range;
  onRange?: (range: Range) => void;
}

/** A colour of the style sheet, as it is in this place: alarms have the colour of their priority. */
const colourOf = (node: Element, name: string): string => getComputedStyle(node).getPropertyValue(`--${name}`).trim();
const dark = matchMedia("(prefers-color-scheme: dark)");

export function Plot(props: PlotProps) {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const latest = useRef(props);
  latest.current = props;
  const shape = JSON.stringify([props.lines, props.band, props.height, props.kind, language()]);
  useEffect(() => {
    const node = place.current;
    if (!node) return undefined;
    const make = (): void => {
      plot.current?.destroy();
      plot.current = new uPlot(optionsOf(latest, node), dataOf(latest.current), node);
    };
    make();
    const observer = new ResizeObserver(() => plot.current?.setSize({ width: node.clientWidth, height: latest.current.height }));
    observer.observe(node);
    dark.addEventListener("change", make);
    return () => {
      observer.disconnect();
      dark.removeEventListener("change", make);
      plot.current?.destroy();
      plot.current = null;
    };
  }, [shape]);
  useEffect(() => {
    const made = plot.current;
    made?.batch(() => {
      made.setData(dataOf(props), false);
      made.setScale("x", { min: props.range[0], max: props.range[1] });
      made.setScale("y", { min: props.scale[0], max: props.scale[1] });
    });
  });
  return <div ref={place} class="plot" role="img" aria-label={props.label} />;
}

const dataOf = (props: PlotProps): uPlot.AlignedData => [props.time, ...props.columns] as uPlot.AlignedData;

function optionsOf(latest: { current: PlotProps }, node: HTMLElement): uPlot.Options {
  const { height, lines, band, kind = "time", onRange } = latest.current;
  const overTime = kind === "time";
  const colour = (name: string): string => colourOf(node, name);
  const axis = { stroke: colour("quiet"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") } };
  return {
    width: node.clientWidth,
    height,
    legend: { show: false },
    cursor: {
      ...(overTime && !onRange ? {} : { sync: { key: kind } }),
      drag: { x: onRange !== undefined, y: false, setScale: false }, y: false, points: { size: 6 },
    },
    scales: { x: { time: overTime, distr: overTime ? 1 : 3, auto: false }, y: { auto: false } },
    axes: [
      { ...axis, size: 28, space: (_, __, from, to) => (overTime && to - from < 60 ? 80 : 50), values: overTime ? timeTexts : frequencyTexts },
      { ...axis, size: 74, space: 18, values: (_, ticks) => tickTexts(ticks) },
    ],
    series: [{}, ...lines.map(({ colour: name, dash, width: w = 1.5, points }) => ({
      stroke: name === "none" ? "transparent" : colour(name), width: w, ...(dash ? { dash } : {}), spanGaps: false,
      ...(points ? { paths: () => null, points: { show: true, size: 6, width: 1.5 } } : { points: { show: name !== "none", filter: alone, size: 4, fill: colour(name) } }),
    }))],
    ...(band ? { bands: [{ series: [band[1] + 1, band[0] + 1] as [number, number], fill: colour("band") }] } : {}),
    hooks: {
      drawClear: [(u) => drawMarks(u, latest.current.marks ?? []), (u) => drawChanges(u, latest.current.changes ?? [])],
      draw: [(u) => drawSigns(u, latest.current.signs ?? [])],
      setSelect: [(u) => {
        const { left, width: w } = u.select;
        if (w < 4) return;
        latest.current.onRange?.([u.posToVal(left, "x"), u.posToVal(left + w, "x")]);
        u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      }],
    },
  };
}

/** A point between two gaps has no line: it is drawn as a point. */
function alone(u: uPlot, series: number): number[] {
  const values = u.data[series] ?? [];
  const isThere = (k: number): boolean => typeof values[k] === "number";
  return Array.from(values, (_, k) => k).filter((k) => isThere(k) && !isThere(k - 1) && !isThere(k + 1));
}

/** Frequencies below the axis: at 1, 2 and 5 times a power of ten. */
const frequencyTexts = (_: uPlot, ticks: number[]): string[] =>
  ticks.map((f) => ([1, 2, 5].includes(Math.round(f / 10 ** Math.floor(Math.log10(f) + 1e-9))) ? local(String(Number(f.toPrecision(3)))) : ""));

/** Times below the axis: the clock, with the date where it changes; dates alone for long ranges. */
function timeTexts(_: uPlot, ticks: number[]): string[] {
  const step = (ticks[1] ?? 0) - (ticks[0] ?? 0);
  let day = "";
  return ticks.map((tick) => {
    const d = new Date(tick * 1000);
    const date = language() === "de" ? `${two(d.getDate())}.${two(d.getMonth() + 1)}.` : `${two(d.getMonth() + 1)}-${two(d.getDate())}`;
    if (step >= 86400 * 28) return `${d.getFullYear()}-${two(d.getMonth() + 1)}`;
    if (step >= 86400) return date;
    const clock = `${two(d.getHours())}:${two(d.getMinutes())}${step < 60 ? `:${two(d.getSeconds())}` : ""}`;
    const changed = day !== "" && day !== date;
    day = date;
    return changed ? `${date} ${clock}` : clock;
  });
}

/** Alarms behind the lines: a tinted span from onset to end, with a bar and an arrow at its top. */
function drawMarks(u: uPlot, marks: Mark[]): void {
  const { ctx, bbox } = u;
  const ratio = devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  for (const { from, to, label } of marks) {
    const left = Math.max(bbox.left, u.valToPos(from, "x", true));
    const right = to === null ? bbox.left + bbox.width : u.valToPos(to, "x", true);
    ctx.globalAlpha = 0.6;
    ctx.fillStyle = colourOf(u.root, "alarm-back");
    ctx.fillRect(left, bbox.top, Math.max(2 * ratio, right - left), bbox.height);
    ctx.globalAlpha = 1;
    ctx.fillStyle = colourOf(u.root, "alarm");
    ctx.fillRect(left, bbox.top, Math.max(2 * ratio, right - left), 3 * ratio);
    ctx.fillRect(left, bbox.top, 1.5 * ratio, bbox.height);
    ctx.font = `${12 * ratio}px sans-serif`;
    ctx.textAlign = "left";
    ctx.fillText(label, left + 4 * ratio, bbox.top + 16 * ratio);
  }
  ctx.restore();
}

function drawChanges(u: uPlot, changes: number[]): void {
  const { ctx, bbox } = u;
  ctx.save();
  ctx.strokeStyle = colourOf(u.root, "quiet");
  ctx.lineWidth = devicePixelRatio;
  for (const at of changes) {
    const x = u.valToPos(at, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
  }
  ctx.restore();
}

/** A line at each position, dashed for nominal values, and its mark above it. */
function drawSigns(u: uPlot, signs: Sign[]): void {
  const { ctx, bbox } = u;
  ctx.save();
  ctx.fillStyle = ctx.strokeStyle = colourOf(u.root, "text");
  ctx.lineWidth = devicePixelRatio;
  ctx.font = `${13 * devicePixelRatio}px sans-serif`;
  ctx.textAlign = "center";
  for (const { at, mark } of signs) {
    const x = u.valToPos(at, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    ctx.setLineDash(mark === "○" ? [3 * devicePixelRatio, 4 * devicePixelRatio] : []);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top + 16 * devicePixelRatio);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.fillText(mark, x, bbox.top + 12 * devicePixelRatio);
  }
  ctx.restore();
}
