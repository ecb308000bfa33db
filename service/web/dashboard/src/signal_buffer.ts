// The last seconds of the signals of an axis, joined from several answers, each with the samples since the one before.
import type { Body } from "./ask";

export type Signals = Body<"Signals">;
type Numbers = (number | null)[];

export const LENGTH_S = 10;
const GAP_S = 0.5; // a longer time without a sample is a gap, not a line across it

/** Time in s since 1970. */
export interface SignalColumns {
  time: number[];
  torque: Numbers;
  measured: Numbers;
  predicted: Numbers;
  error: Numbers;
  /** Errors of samples that were not used for learning. */
  passed: Numbers;
}

const NAMES = ["torque", "measured", "predicted", "error", "passed"] as const;

export const emptySignals = (): SignalColumns => ({ time: [], torque: [], measured: [], predicted: [], error: [], passed: [] });

/** The columns with those of an answer appended, without values that are too old; an earlier answer replaces them. */
export function joined(before: SignalColumns, answer: Signals): SignalColumns {
  if (answer.begin === null) return before;
  const begin = Date.parse(answer.begin) / 1000;
  const to = begin > (before.time.at(-1) ?? -Infinity) ? structuredClone(before) : emptySignals();
  answer.time_s.forEach((s, i) => {
    const time = begin + s;
    const last = to.time.at(-1);
    if (last !== undefined && time > last + GAP_S) push(to, (last + time) / 2, {});
    const error = answer.error[i] ?? null;
    push(to, time, {
      torque: answer.torque[i] ?? null,
      measured: answer.measured[i] ?? null,
      predicted: answer.predicted[i] ?? null,
      error,
      passed: answer.learned[i] ? null : error,
    });
  });
  const oldest = (to.time.at(-1) ?? 0) - LENGTH_S;
  const first = to.time.findIndex((time) => time >= oldest);
  to.time.splice(0, first);
  for (const name of NAMES) to[name].splice(0, first);
  return to;
}

function push(to: SignalColumns, time: number, row: Partial<Record<(typeof NAMES)[number], number | null>>): void {
  to.time.push(time);
  for (const name of NAMES) to[name].push(row[name] ?? null);
}
