// The slow trend of each parameter of an axis: hourly or daily means, the trend with its forecast band, the limits.
import { useState } from "preact/hooks";
import type { Body } from "./ask";
import { unit } from "./format";
import { Plot } from "./plot";
import { usePolled } from "./polled";
import { Words } from "./sentences";
import { rangeOf } from "./series";
import { t } from "./texts";
import { trendColumns } from "./trend_columns";

const EVERY_MS = 60_000;
const POINTS = 400;

export function Trends({ id }: { id: string }) {
  const [trend] = usePolled<Body<"Trend">>(`/api/v1/axes/${encodeURIComponent(id)}/trend?points=${POINTS}`, EVERY_MS);
  const known = trend?.parameters.filter((p) => p.drift !== null) ?? [];
  return (
    <section aria-label={t.trend}>
      <h2>{t.trend}</h2>
      {known.length === 0 ? <p class="quiet">{trend === null ? t.waiting : t.noTrend}</p> : <p class="quiet">{t.trendLegend}</p>}
      {known.map((p) => <TrendPanel key={p.name} p={p} />)}
    </section>
  );
}

function Course({ p }: { p: Body<"LongTermHistory"> }) {
  const own = t.course(p, unit(p.unit));
  if (own === null) return <Words>{[p.words, ...p.limits.map((limit) => limit.words)].join("; ")}</Words>;
  const from = p.drift?.time ?? new Date().toISOString();
  return <bdi>{[own, ...p.limits.map((limit) => t.reach(limit, unit(limit.unit), from))].join("; ")}</bdi>;
}

const MEAN = { colour: "text" };
const FORECAST = { colour: "text", dash: [6, 4] };
const NOMINAL = { colour: "quiet", dash: [2, 3] };
const LIMIT = { colour: "alarm", width: 4 };
const HIDDEN = { colour: "none" };

function TrendPanel({ p }: { p: Body<"LongTermHistory"> }) {
  const c = trendColumns(p);
  const range: [number, number] = [c.time[0] ?? 0, c.time.at(-1) ?? 1];
  const [shown, show] = useState<[number, number] | null>(null);
  return (
    <div class="panel trend">
      <p><b><bdi>{p.name}</bdi></b>: <Course p={p} /></p>
      <Plot label={t.trendPlot(p.name)} height={180} time={c.time} range={shown ?? range} onRange={show}
        columns={[c.low, c.high, c.nominal, c.trend, c.mean, ...c.limits]} band={[0, 1]}
        lines={[HIDDEN, HIDDEN, NOMINAL, FORECAST, MEAN, ...c.limits.map(() => LIMIT)]}
        scale={rangeOf([c.low, c.high, c.nominal, c.mean, ...c.limits])} />
      {shown && <button type="button" onClick={() => show(null)}>{t.wider}</button>}
    </div>
  );
}
