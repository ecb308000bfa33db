// Urgency of the axes: their need, and the order, filter and search of the overview.
import type { Alarm, Axis, Parameter } from "./ask";

/** From the most urgent to the least. */
export const NEEDS = ["alarm", "acknowledged", "silent", "untested", "service", "normal"] as const;
export type Need = (typeof NEEDS)[number];

export interface Item {
  axis: Axis;
  need: Need;
  /** The shown active alarms, the most urgent first, of equal ones the earliest first. */
  alarms: Alarm[];
  /** The active alarms that are not shown. */
  hidden: Alarm[];
}

const PRIORITIES = ["high", "medium", "low"];

/** Hidden by a person or by the configuration. */
export const isHidden = (alarm: Alarm): boolean => ["shelved", "suppressed", "out-of-service"].includes(alarm.state);

/** Key of an alarm, which stays the same when it is recorded or gets another name. */
export const keyOf = (alarm: Alarm): string => `${alarm.axis} ${alarm.raised} ${(alarm.past[0] ?? alarm).parameter}`;

/** Smaller is more urgent: by priority; acknowledged alarms come last. */
export const urgency = (alarm: Alarm): number => PRIORITIES.indexOf(alarm.priority) + (alarm.state === "acknowledged" ? 10 : 0);

/** The larger one of the two test statistics, relative to its threshold; 0 where there is none. */
export const evidence = (p: Parameter): number =>
  p.threshold !== null && p.threshold > 0 ? Math.max(p.cusum.up ?? 0, p.cusum.down ?? 0) / p.threshold : 0;

function needOf(axis: Axis, alarms: Alarm[]): Need {
  if (alarms.some((alarm) => alarm.state !== "acknowledged")) return "alarm";
  if (alarms.length > 0) return "acknowledged";
  if (axis.out_of_service) return "service";
  if (axis.silent) return "silent";
  return axis.parameters.some((p) => !p.tested) ? "untested" : "normal";
}

/** Each axis with its shown alarms and its need. */
export function itemsOf(axes: Axis[], active: Alarm[]): Item[] {
  const [shown, hidden] = [new Map<string, Alarm[]>(), new Map<string, Alarm[]>()];
  for (const alarm of active) {
    const group = isHidden(alarm) ? hidden : shown;
    group.set(alarm.axis, [...(group.get(alarm.axis) ?? []), alarm]);
  }
  return axes.map((axis) => {
    // Of equal ones the first: later ones may be its consequence.
    const alarms = (shown.get(axis.id) ?? []).sort((a, b) => urgency(a) - urgency(b) || Date.parse(a.raised) - Date.parse(b.raised));
    return { axis, alarms, hidden: hidden.get(axis.id) ?? [], need: needOf(axis, alarms) };
  });
}

const byName = (a: Item, b: Item): number => a.axis.id.localeCompare(b.axis.id, undefined, { numeric: true });

/** By need, then by urgency of the alarms, then by the evidence for a change; or only by name. */
export function ordered(items: Item[], order: "need" | "name"): Item[] {
  if (order === "name") return [...items].sort(byName);
  const first = ({ alarms }: Item): number => (alarms[0] ? urgency(alarms[0]) : 0);
  // Rounded, so that axes with nearly equal evidence do not change places each second.
  const strongest = ({ axis }: Item): number => Math.floor(4 * Math.max(0, ...axis.parameters.map(evidence)));
  return [...items].sort(
    (a, b) =>
      NEEDS.indexOf(a.need) - NEEDS.indexOf(b.need) || first(a) - first(b) || strongest(b) - strongest(a) || byName(a, b),
  );
}

/** Whether all words of a search occur in the names of an axis, its parameters and alarms. */
export function matches({ axis, alarms }: Item, search: string): boolean {
  const names = [axis.id, axis.bus, ...axis.parameters.flatMap((p) => [p.name, p.meaning]), ...alarms.map((a) => a.parameter)];
  const text = names.join("\n").toLowerCase();
  return search.toLowerCase().split(/\s+/).every((word) => text.includes(word));
}
