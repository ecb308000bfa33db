// The most frequent names of alarms in seven days, and the number of alarms per ten minutes.
import type { Body } from "./ask";
import { count, few, percent } from "./format";
import { arrow, axisLink, Time } from "./marks";
import { usePolled } from "./polled";
import { causeName } from "./sentences";
import { Table } from "./table";
import { t } from "./texts";

/** The number of alarms in seven days, as entries of a list. */
export const LoadFigures = ({ found }: { found: Body<"AlarmStatistics"> }) => (
  <>
    <dt>{t.raisedWeek}</dt><dd>{count(found.raised)}</dd>
    <dt>{t.perTenMinutes}</dt><dd>{few(found.mean_per_ten_minutes)}</dd>
    <dt>{t.worstTenMinutes}</dt><dd>{count(found.most_in_ten_minutes)}{found.most_at !== null && <small><Time at={found.most_at} /></small>}</dd>
  </>
);

export function AlarmFrequency() {
  const [found] = usePolled<Body<"AlarmStatistics">>("/api/v1/alarms/statistics");
  if (found === null) return <p class="quiet">{t.waiting}</p>;
  const { axis, parameter, alarms } = t.frequency;
  return (
    <>
      <dl>
        <LoadFigures found={found} />
        <dt>{t.frequency.floods}</dt><dd>{percent(found.flood_share, false)}</dd>
      </dl>
      {found.most_frequent.length === 0 ? <p class="quiet">{t.noAlarmHere}</p> : (
        <Table label={t.alarmFilter.frequent} columns={[alarms, axis, parameter]} rows={found.most_frequent.map((name) => [
          count(name.alarms),
          <a href={axisLink(name.axis)}><bdi>{name.axis}</bdi></a>,
          <><bdi>{causeName(name.parameter)}</bdi> {arrow(name.direction)} {t.direction[name.direction]}</>,
        ])} />
      )}
    </>
  );
}
