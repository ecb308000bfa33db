// Converts the trend of the API to columns for plots.
import type { Body } from "./ask";

const DAY_S = 86400;
const STEPS = 40; // of the forecast

export interface TrendColumns {
  time: number[];
  mean: (number | null)[];
  nominal: (number | null)[];
  trend: (number | null)[];
  low: (number | null)[];
  high: (number | null)[];
  /** For each limit: its value from the earliest to the latest time at which it is reached. */
  limits: (number | null)[][];
}

const seconds = (iso: string): number => Date.parse(iso) / 1000;

/** Means, then the trend from its first entry to the latest time of a limit, at most as far ahead as the history is long. */
export function trendColumns(p: Body<"LongTermHistory">): TrendColumns {
  const { drift } = p;
  const times = p.time.map(seconds);
  const [first, last] = [times[0] ?? 0, times.at(-1) ?? 0];
  const reached = p.limits.filter((limit) => limit.state === "ahead" && limit.name === p.name);
  const farthest = Math.max(last + 0.5 * (last - first), ...reached.map((limit) => seconds(limit.high ?? limit.low)));
  const end = Math.min(farthest, last + 2 * (last - first));
  const ahead = Array.from({ length: STEPS }, (_, i) => last + ((i + 1) * (end - last)) / STEPS);
  const time = [...times, ...ahead];
  const [level, levelSd] = [drift?.level ?? null, drift?.level_sd ?? 0];
  const [slope, slopeSd] = [drift?.slope_per_day ?? 0, drift?.slope_per_day_sd ?? 0];
  const [from, since] = [drift ? seconds(drift.time) : last, drift ? seconds(drift.since) : last];
  const trend = time.map((at) => (level === null || at < since ? null : level + (slope * (at - from)) / DAY_S));
  const spread = (at: number): number => 2 * Math.hypot(levelSd, (slopeSd * (at - from)) / DAY_S);
  const edge = (sign: number) => time.map((at, i) => {
    const middle = trend[i] ?? null;
    return middle === null || at < from ? null : middle + sign * spread(at);
  });
  return {
    time,
    mean: [...p.mean, ...ahead.map(() => null)],
    nominal: time.map(() => p.nominal),
    trend,
    low: edge(-1),
    high: edge(1),
    limits: reached.map(({ low, high, limit }) => {
      const [a, b] = [seconds(low), high === null ? Infinity : seconds(high)];
      return time.map((at) => (at >= a && at <= b ? limit : null));
    }),
  };
}
