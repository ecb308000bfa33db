// The alarms: the active ones, or another part of the journal.
import { useState } from "preact/hooks";
import { AlarmButtons } from "./alarm_actions";
import { AlarmFrequency } from "./alarm_frequency";
import { download, hasToken, type Alarm, type Body } from "./ask";
import { moment, percent, span, unit, withMargin } from "./format";
import { useLive } from "./live";
import { AlarmWords } from "./alarm_words";
import { alarmLink, AlarmMark, arrow, axisLink, Time } from "./marks";
import { isHidden } from "./need";
import { useFollowed } from "./polled";
import { causeName } from "./sentences";
import { Z90 } from "./series";
import { Table, type Cells } from "./table";
import { t } from "./texts";

const QUERIES = {
  active: "active=true", unacknowledged: "state=unacknowledged", shelved: "state=shelved", stale: "state=stale",
  chattering: "state=chattering", ended: "active=false", all: "",
};
type Filter = keyof typeof QUERIES;
const CHOICES = [...(Object.keys(QUERIES) as Filter[]), "frequent"] as const;
const LIMIT = 100;

export function AlarmList() {
  const [chosen, choose] = useState<(typeof CHOICES)[number]>("active");
  return (
    <>
      <h1>{t.alarms}</h1>
      <div class="tools">
        <div class="choice" role="group" aria-label={t.filter}>
          {CHOICES.map((name) => (
            <button key={name} type="button" aria-pressed={chosen === name} onClick={() => choose(name)}>
              {t.alarmFilter[name]}
            </button>
          ))}
        </div>
      </div>
      {chosen === "frequent" ? <AlarmFrequency /> : <Found key={chosen} filter={chosen} />}
    </>
  );
}

/** A page of the alarms; each older page starts where the one before ended. A button at the end keeps the focus. */
function Found({ filter }: { filter: Filter }) {
  const [before, turn] = useState<string[]>([]);
  const cursor = before.at(-1);
  const [found, refresh] = useAlarms(cursor === undefined ? QUERIES[filter] : `${QUERIES[filter]}&cursor=${encodeURIComponent(cursor)}`, LIMIT);
  const older = found?.next ?? null;
  const turning = older !== null && older === cursor; // the page before is still shown
  const first = (before.length - (turning ? 1 : 0)) * LIMIT;
  return (
    <>
      {found === null ? <p class="quiet">{t.waiting}</p> : <AlarmTable alarms={found.alarms} refresh={refresh} axis />}
      {found !== null && (before.length > 0 || older !== null) && (
        <p class="tools">
          <button type="button" aria-disabled={before.length === 0} onClick={() => turn(before.slice(0, -1))}>{t.newerAlarms}</button>
          <button type="button" aria-disabled={older === null} onClick={() => older !== null && !turning && turn([...before, older])}>{t.olderAlarms}</button>
          <span class="quiet" role="status">{t.alarmsOf(first + 1, first + found.alarms.length, found.total)}</span>
        </p>
      )}
      {found?.total === 0 && <p class="quiet">{filter === "all" ? t.noAlarm : t.noAlarmHere}</p>}
    </>
  );
}

/** The alarms of a query, requested again when the active ones change, and periodically. */
export function useAlarms(query: string, limit: number): [Body<"Alarms"> | null, () => Promise<void>] {
  const { active } = useLive();
  const key = JSON.stringify(active.map((alarm) => [alarm.id, alarm.state, alarm.parameter, alarm.updated, alarm.work_order, alarm.first_out]));
  const [found, , refresh] = useFollowed<Body<"Alarms">>(`/api/v1/alarms?${query}&limit=${limit}`, key);
  return [found, refresh];
}

/** A table of alarms; `axis`: with the column of the axes. */
export function AlarmTable({ alarms, refresh, axis = false }: { alarms: Alarm[]; refresh: () => Promise<void>; axis?: boolean }) {
  if (alarms.length === 0) return null;
  const { action, axis: ofAxis, ...others } = t.columns;
  const { state, ...rest } = others;
  const columns = [state, ...(axis ? [ofAxis] : []), ...Object.values(rest), action];
  return (
    <Table label={t.alarms} kind="alarms" columns={columns} rows={alarms.map((alarm) => cellsOf(alarm, refresh, axis))} most={LIMIT}
      keys={alarms.map((alarm) => alarm.id ?? alarm.raised)} tones={alarms.map((alarm) => `${alarm.active ? "active" : "ended"} prio-${alarm.priority}`)} />
  );
}

const cellsOf = (alarm: Alarm, refresh: () => Promise<void>, axis: boolean): Cells => [
  <State alarm={alarm} />,
  ...(axis ? [<a href={axisLink(alarm.axis)}><bdi>{alarm.axis}</bdi></a>] : []),
  <>
    <a href={alarmLink(alarm.id)}><b><bdi>{causeName(alarm.parameter)}</bdi></b> {arrow(alarm.direction)} {t.direction[alarm.direction]}</a>
    <Names alarm={alarm} />
    <small><AlarmWords alarm={alarm} /></small>
  </>,
  sizeText(alarm),
  <><Time at={alarm.onset} /><OnsetRange alarm={alarm} /></>,
  <Time at={alarm.raised} />,
  alarm.ended === null ? "–" : <Time at={alarm.ended} />,
  <AlarmButtons alarm={alarm} done={refresh} />,
];

/** State of an alarm, actions on it, its priority, and whether the journal has it. */
export function State({ alarm }: { alarm: Alarm }) {
  const urgent = alarm.active && !isHidden(alarm) ? " urgent" : "";
  const until = alarm.shelved_until === null ? "" : ` ${t.until(moment(alarm.shelved_until))}`;
  const state = alarm.state === "normal" ? [] : [(t.alarmState[alarm.state] ?? alarm.state) + until];
  return (
    <>
      <span class="nowrap"><AlarmMark alarm={alarm} /> <span class={`pill${urgent}`}>{alarm.active ? t.active : t.endedPill}</span></span>
      {!alarm.recorded && <> <span class="pill warn">{t.notRecorded}</span></>}
      {alarm.first_out && <> <span class="pill" title={t.firstOutMeaning}>{t.firstOut}</span></>}
      <small>{[...state, t.priority[alarm.priority]].join(", ")}</small>
      {alarm.follows !== null && <small><a href={alarmLink(alarm.follows)}>{t.follows(alarm.follows)}</a></small>}
      {alarm.recording !== null && <small><Frames name={alarm.recording} /></small>}
      {alarm.work_order !== null && <small><bdi>{t.workOrder(alarm.work_order)}</bdi></small>}
    </>
  );
}

/** The raw frames around an alarm, to download. */
export const Frames = ({ name, full = false }: { name: string; full?: boolean }) => (
  <Saved path={`/api/v1/recordings/${encodeURIComponent(name)}`} name={name}>{full ? name : t.frames}</Saved>
);

/** A file to download; a link sends no token, so with one the page fetches it. */
export function Saved({ path, name, children }: { path: string; name: string; children: string }) {
  const fetched = (event: MouseEvent): void => {
    if (!hasToken()) return;
    event.preventDefault();
    void download(path, name);
  };
  return <a href={path} download={name} onClick={fetched}>{children}</a>;
}

/** That it has no name yet, or its earlier name. */
function Names({ alarm }: { alarm: Alarm }) {
  if (alarm.stage === "changed") return alarm.active ? <span class="quiet"> {t.notNamed}</span> : null;
  const before = [...new Set(alarm.past.map((name) => name.parameter))].filter((name) => name !== alarm.parameter);
  return before.length === 0 ? null : <span class="quiet"> {t.atFirst(before.map(causeName).join(", "))}</span>;
}

/** The ends of the interval in which the onset lies, as far as they are known. */
function onsetRange(alarm: Alarm): string {
  if (alarm.onset_low === null && alarm.onset_high === null) return "";
  const [low, high] = [alarm.onset_low, alarm.onset_high].map((end) => (end === null ? t.unknown : moment(end)));
  return t.onsetRange(low ?? "", high ?? "");
}

/** Their distance from the onset; `full`: in words. */
export function OnsetRange({ alarm, full = false }: { alarm: Alarm; full?: boolean }) {
  const { onset, onset_low: low, onset_high: high } = alarm;
  const away = (end: string): string => span(Math.abs(Date.parse(end) - Date.parse(onset)) / 1000);
  const [before, after] = [low && `−${away(low)}`, high && `+${away(high)}`];
  if (!before && !after) return null;
  return (
    <small title={onsetRange(alarm)}>
      {full ? t.onsetRange(before ?? t.unknown, after ?? t.unknown) : <span class="nowrap">{[before, after].filter(Boolean).join(" ")}</span>}
    </small>
  );
}

/** Size with its 90 % interval, also as a share of nominal. */
export function sizeText(alarm: Alarm): string {
  if (alarm.size === null) return alarm.active ? t.notKnown : "–";
  const share = alarm.nominal ? ` (${percent(alarm.size / Math.abs(alarm.nominal))})` : "";
  return `${withMargin(alarm.size, Z90 * (alarm.size_sd ?? 0), true)} ${unit(alarm.unit)}${share}`;
}
