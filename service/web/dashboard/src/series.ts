// Converts the history of the API to columns for plots: gaps, missing numbers, constant values.
import type { Alarm, Body } from "./ask";
import { NUMBERS, type LivePoint } from "./live_buffer";

type Numbers = (number | null)[];

export type History = Body<"History">;
type Quantity = Body<"HistoryColumn">;

/** Columns of a parameter; null is a gap. Time in s since 1970, the statistics relative to the threshold. */
export interface Columns {
  time: number[];
  estimate: Numbers;
  low: Numbers;
  high: Numbers;
  nominal: Numbers;
  up: Numbers;
  down: Numbers;
}

const NAMES = ["estimate", "low", "high", "nominal", "up", "down"] as const;
type Row = Partial<Record<(typeof NAMES)[number], number | null>>;

/** Half the width of a band that holds 90 % of a normal distribution, in standard deviations. */
export const Z90 = 1.645;

const finite = (x: number | null | undefined): number | null => (typeof x === "number" && Number.isFinite(x) ? x : null);
const minus = (a: number | null, b: number | null): number | null => (a === null || b === null ? null : a - b);
const share = (g: number | null, h: number | null): number | null => (g === null || h === null || h <= 0 ? null : g / h);

function row(estimate: number | null, sd: number | null, nominal: number | null, g: (number | null)[], h: number | null): Row {
  const half = sd === null ? null : Z90 * sd;
  const low = minus(estimate, half);
  const high = half === null ? null : minus(estimate, -half);
  return { estimate, low, high, nominal, up: share(g[0] ?? null, h), down: share(g[1] ?? null, h) };
}

export const emptyColumns = (): Columns => ({ time: [], estimate: [], low: [], high: [], nominal: [], up: [], down: [] });

function push(to: Columns, time: number, values: Row): void {
  to.time.push(time);
  for (const name of NAMES) to[name].push(values[name] ?? null);
}

/** The columns of one parameter: its history, then the values that the page itself has received since. */
export function columnsOf(name: string, history: History | null, live: LivePoint[]): Columns {
  const columns = emptyColumns();
  const p = history?.parameters.find((one) => one.name === name);
  if (history && p) addHistory(columns, history, p);
  const step = Math.max(history?.step_s ?? 0, 10);
  for (const point of live) {
    const last = columns.time.at(-1);
    if (last !== undefined && point.time <= last) continue;
    // No value for some steps: a gap, not a line across it.
    if (last !== undefined && point.time > last + 3 * step) push(columns, (last + point.time) / 2, {});
    addLive(columns, name, point);
  }
  return columns;
}

function addHistory(to: Columns, history: History, p: Body<"ParameterHistory">): void {
  history.time.forEach((iso, i) => {
    const of = (q: Quantity): number | null => (p.n[i] === 0 ? null : finite(q.mean[i]));
    const estimate = of(p.estimate);
    const g = [of(p.cusum_up), of(p.cusum_down)];
    push(to, Date.parse(iso) / 1000, row(estimate, of(p.standard_deviation), minus(estimate, of(p.deviation)), g, of(p.threshold)));
  });
}

function addLive(to: Columns, name: string, { time, names, numbers }: LivePoint): void {
  const first = NUMBERS * names.indexOf(name);
  if (first < 0) return;
  const [estimate, sd, nominal, up, down, h] = numbers.slice(first, first + NUMBERS).map(finite);
  push(to, time, row(estimate ?? null, sd ?? null, nominal ?? null, [up ?? null, down ?? null], h ?? null));
}

/** The range of an axis of a plot that shows all these values, with a margin; never empty. */
export function rangeOf(columns: Numbers[], least: [number, number] | null = null): [number, number] {
  let [low, high] = least ?? [Infinity, -Infinity];
  for (const column of columns) {
    for (const x of column) {
      if (x === null || !Number.isFinite(x)) continue;
      low = Math.min(low, x);
      high = Math.max(high, x);
    }
  }
  if (low > high) return [0, 1];
  const size = high - low;
  // A constant value: its line is in the middle.
  const margin = size > 1e-9 * Math.max(Math.abs(low), Math.abs(high)) ? 0.06 * size : Math.max(Math.abs(high) * 0.1, 1e-12);
  return [low - margin, high + margin];
}

export interface Mark {
  from: number;
  to: number | null;
  label: string;
  id: number | null;
}

/**
 * The alarms of a parameter in a range of time [s since 1970], from onset to end; null: not ended. Alarms without a
 * monitored parameter, such as a sensor fault, apply to all.
 */
export function marksOf(alarms: Alarm[], parameter: string, monitored: string[], from: number, to: number): Mark[] {
  return alarms
    .filter((alarm) => alarm.parameter === parameter || !monitored.includes(alarm.parameter))
    .map((alarm) => ({
      from: Date.parse(alarm.onset) / 1000,
      to: alarm.ended === null ? null : Date.parse(alarm.ended) / 1000,
      label: alarm.direction === "up" ? "▲" : "▼",
      id: alarm.id,
    }))
    .filter((mark) => mark.from <= to && (mark.to ?? Infinity) >= from);
}
