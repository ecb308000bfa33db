// The names that were raised most often in seven days, and how many alarms came in ten minutes.
import { useEffect, useState } from "preact/hooks";
import { ask, type Body } from "./ask";
import { count, few, percent } from "./format";
import { arrow, axisLink, Time } from "./marks";
import { causeName } from "./sentences";
import { t } from "./texts";

const EVERY_MS = 30_000;

export function AlarmFrequency() {
  const [found, set] = useState<Body<"AlarmStatistics"> | null>(null);
  useEffect(() => {
    const load = (): void => void ask<Body<"AlarmStatistics">>("/api/v1/alarms/statistics").then(set, () => undefined);
    load();
    const timer = setInterval(load, EVERY_MS);
    return () => clearInterval(timer);
  }, []);
  if (found === null) return <p class="quiet">{t.waiting}</p>;
  const { axis, parameter, alarms } = t.frequency;
  return (
    <>
      <dl>
        <dt>{t.raisedWeek}</dt><dd>{count(found.raised)}</dd>
        <dt>{t.perTenMinutes}</dt><dd>{few(found.mean_per_ten_minutes)}</dd>
        <dt>{t.worstTenMinutes}</dt><dd>{count(found.most_in_ten_minutes)}{found.most_at !== null && <small><Time at={found.most_at} /></small>}</dd>
        <dt>{t.frequency.floods}</dt><dd>{percent(found.flood_share, false)}</dd>
      </dl>
      {found.most_frequent.length === 0 ? <p class="quiet">{t.noAlarmHere}</p> : (
        <div class="panel">
          <table role="table" aria-label={t.alarmFilter.frequent}>
            <thead><tr>{[alarms, axis, parameter].map((name) => <th key={name} scope="col">{name}</th>)}</tr></thead>
            <tbody>
              {found.most_frequent.map((name) => (
                <tr key={`${name.axis} ${name.parameter} ${name.direction}`}>
                  <td>{count(name.alarms)}</td>
                  <td><a href={axisLink(name.axis)}><bdi>{name.axis}</bdi></a></td>
                  <td><bdi>{causeName(name.parameter)}</bdi> {arrow(name.direction)} {t.direction[name.direction]}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </>
  );
}
