// Elements that several pages share: the mark of a state by its shape, the bar of a parameter, times.
import type { Alarm, Parameter } from "./ask";
import { local, moment, number, percent, stamp, unit, withMargin } from "./format";
import { isHidden, type Item, type Need } from "./need";
import { Z90 } from "./series";
import { causeName } from "./sentences";
import { t } from "./texts";

const PRIORITY: Record<string, string> = { high: "1", medium: "2", low: "3" };
const OUTLINES: Record<string, string> = {
  high: "M2 2H18V18H2Z",
  medium: "M10 1 19 18H1Z",
  low: "M10 1 19 10 10 19 1 10Z",
};

/** Priority by shape, number and colour; only an outline once the alarm is acknowledged. */
export function AlarmMark({ alarm }: { alarm: Alarm }) {
  const idle = !alarm.active || isHidden(alarm) ? " idle" : "";
  const known = alarm.state === "acknowledged" ? " known" : "";
  return (
    <svg class={`mark ${alarm.priority}${idle}${known}`} viewBox="0 0 20 20" role="img" aria-label={t.priority[alarm.priority]}>
      <path d={OUTLINES[alarm.priority] ?? ""} />
      <text x="10" y={alarm.priority === "medium" ? 16 : 14.5}>{PRIORITY[alarm.priority] ?? ""}</text>
    </svg>
  );
}

/** The mark of an axis without an active alarm. */
export function NeedMark({ need }: { need: Need }) {
  if (need === "silent") {
    return <svg class="mark silent" viewBox="0 0 20 20" aria-hidden="true"><path d="M3 3 17 17M17 3 3 17" /></svg>;
  }
  if (need === "service") return <svg class="mark service" viewBox="0 0 20 20" aria-hidden="true"><path d="M2 7H18V13H2ZM5 13 9 7M11 13 15 7" /></svg>;
  if (need === "untested") return <svg class="mark untested" viewBox="0 0 20 20" aria-hidden="true"><circle cx="10" cy="10" r="7" /></svg>;
  return null;
}

const HALF_WIDTH = 0.4; // the ends of a bar, in shares of nominal

/** Estimate minus nominal; null if one of them is missing, or before the first sample. */
export const deviationOf = (p: Parameter): number | null =>
  p.status === "waiting" || p.estimate === null || p.nominal === null ? null : p.estimate - p.nominal;

export const arrow = (direction: string): string => (direction === "up" ? "▲" : "▼");

/** Deviation as a share of nominal, or in its unit if nominal is zero. */
export function deviationText(p: Parameter): string {
  const d = deviationOf(p);
  if (p.nominal) return percent(d === null ? null : d / Math.abs(p.nominal));
  return d === null ? "–" : `${withMargin(d, null, true)} ${unit(p.unit)}`;
}

/** The same in short: if nominal is zero, two digits beside the estimate with its unit. */
export function shareText(p: Parameter): string {
  const d = deviationOf(p);
  return p.nominal || d === null ? deviationText(p) : `${d > 0 ? "+" : ""}${local(String(Number(d.toPrecision(2))))}`;
}

/** "tracking", "not tested", "alarm". */
export const stateOf = (p: Parameter): string =>
  p.tested || p.status === "alarm" ? (t.status[p.status] ?? p.status)
    : p.status === "seeding" ? t.learning : t.notTested;

/** The estimate with its 90 % interval; before the first sample there is none. */
export const estimateText = (p: Parameter): string =>
  p.status === "waiting" || p.estimate === null ? "–" : `${withMargin(p.estimate, Z90 * (p.standard_deviation ?? 0))} ${unit(p.unit)}`.trim();

/** State in which a parameter is drawn. */
export const kindOf = (p: Parameter): string => (p.status === "alarm" ? "out" : p.tested ? "" : "untested");

/** The deviation of a parameter with its 90 % band, on its normal band. */
export function Bar({ p }: { p: Parameter }) {
  // A nominal value of zero has no percentage: then the bar is five tolerances wide on each side.
  const half = p.nominal ? HALF_WIDTH * Math.abs(p.nominal) : 5 * (p.tolerance || 1);
  const place = (d: number): number => Math.min(1, Math.max(0, 0.5 + d / (2 * half)));
  const part = (from: number, to: number) => ({ "margin-left": `${100 * place(from)}%`, width: `${100 * (place(to) - place(from))}%` });
  const d = deviationOf(p);
  const sd = p.standard_deviation ?? 0;
  const thick = p.status === "alarm" ? 6 : 4; // of the tick [px]
  return (
    <span class={`bar ${kindOf(p)}`} aria-hidden="true">
      <i class="zone" style={part(-(p.tolerance ?? 0), p.tolerance ?? 0)} />
      <i class="middle" />
      {d !== null && <i class="band" style={part(d - Z90 * sd, d + Z90 * sd)} />}
      {d !== null && <i class="tick" style={{ "margin-left": `clamp(0px, ${100 * place(d)}% - ${thick / 2}px, 100% - ${thick}px)`, width: `${thick}px` }} />}
    </span>
  );
}

/** The meaning of a bar, in words. */
export const barText = (p: Parameter): string =>
  `${p.name} ${estimateText(p)}, ${p.status === "waiting" ? "" : `${deviationText(p)}, `}${stateOf(p)}`;

/** A time; on paper always with its date, since "today" is ambiguous there. */
export function Time({ at }: { at: string }) {
  const [shown, dated] = [moment(at), stamp(at)];
  return (
    <time dateTime={at} title={at} class="nowrap">
      {shown !== dated && <span class="print-date">{dated.slice(0, -shown.length)}</span>}{shown}
    </time>
  );
}

export const axisLink = (id: string): string => `#/axes/${encodeURIComponent(id)}`;
export const alarmLink = (id: number | null): string => (id === null ? "#/alarms" : `#/alarms/${id}`);

/** The state of an axis, in words. */
export function needText({ axis, need, alarms }: Item): string {
  const first = alarms[0];
  const more = alarms.length > 1 ? ` +${alarms.length - 1}` : "";
  if (first) return `${arrow(first.direction)} ${causeName(first.parameter)}${more}`;
  if (need === "silent") return axis.last_sample_age_s === null ? t.noSample : t.needs.silent;
  if (need === "service") return t.needs.service;
  if (need === "untested") return axis.parameters.some((p) => p.status === "seeding") ? t.learning : t.notTested;
  return "";
}

/** An alarm that is not shown, in words: without it, its axis would seem to be normal. */
export function hiddenText({ hidden }: Item): string {
  const first = hidden[0];
  return first ? `${t.alarmState[first.state] ?? first.state}: ${arrow(first.direction)} ${causeName(first.parameter)}` : "";
}

export const numberWithUnit = (x: number | null, of: string): string => `${number(x)} ${unit(of)}`.trim();
