// One alarm for the person who goes to the axis: finding, certainty, time, and what to do. Printed on one sheet.
import { useState } from "preact/hooks";
import { AlarmButtons } from "./alarm_actions";
import { Frames, OnsetRange, Saved, sizeText, State } from "./alarm_list";
import { ask, type AlarmRecord, type Axis } from "./ask";
import { percent, stamp, zone } from "./format";
import { useLive } from "./live";
import { AlarmWords, Meaning, meaningOf, Reached, stepText } from "./alarm_words";
import { arrow, axisLink, numberWithUnit, Time } from "./marks";
import { useFollowed } from "./polled";
import { causeName, failure, noteText, whoName, Words } from "./sentences";
import { Table, type Cells } from "./table";
import { t } from "./texts";

export function AlarmPage({ id }: { id: string }) {
  const live = useLive();
  const key = JSON.stringify(live.active.find((one) => String(one.id) === id) ?? null);
  const [alarm, problem, refresh] = useFollowed<AlarmRecord>(`/api/v1/alarms/${encodeURIComponent(id)}`, key);
  if (alarm === null) return <p class="quiet">{problem || t.waiting}</p>;
  const axis = live.axes.find((one) => one.id === alarm.axis);
  const meaning = axis?.parameters.find((p) => p.name === alarm.parameter)?.meaning ?? "";
  const report = live.service?.report;
  return (
    <article class={`alarm-page prio-${alarm.priority}`} aria-label={t.alarmTitle(alarm.id ?? 0)}>
      <div class="title">
        <h1>{t.alarmTitle(alarm.id ?? 0)}: <a href={axisLink(alarm.axis)}><bdi>{alarm.axis}</bdi></a></h1>
        <span class="no-print"><AlarmButtons alarm={alarm} done={refresh} /> <button type="button" onClick={() => print()}>{t.print}</button></span>
      </div>
      <p class="sentence"><AlarmWords alarm={alarm} /></p>
      {alarm.reaches.map((reach) => <p key={reach.name} class="sentence"><Reached reach={reach} from={alarm.updated} /></p>)}
      <div class="columns">
        <section>
          <h2>{t.found}</h2>
          <dl>
            <dt>{t.state}</dt><dd><State alarm={alarm} /></dd>
            <dt>{t.columns.parameter}</dt><dd><bdi>{causeName(alarm.parameter)}</bdi> {arrow(alarm.direction)} {t.direction[alarm.direction]}{meaning && <small><Meaning of={meaning} /></small>}</dd>
            <dt>{t.columns.size}</dt><dd>{sizeText(alarm)}</dd>
            <dt>{t.nominal}</dt><dd>{numberWithUnit(alarm.nominal, alarm.unit)}</dd>
            <dt>{t.columns.onset}</dt><dd><Time at={alarm.onset} /><OnsetRange alarm={alarm} full /></dd>
            <dt>{t.columns.raised}</dt><dd><Time at={alarm.raised} /></dd>
            <dt>{t.columns.ended}</dt><dd>{alarm.ended === null ? "–" : <Time at={alarm.ended} />}</dd>
            <dt>{t.kindLabel}</dt><dd>{t.kind[alarm.kind]}</dd>
            <dt>{t.crossings}</dt><dd>{t.times(alarm.crossings)}</dd>
          </dl>
        </section>
        <section>
          <h2>{t.howSure}</h2>
          {alarm.stage === "changed" && <p>{t.stageChanged}</p>}
          {alarm.doubt && <p>{t.doubt[alarm.doubt]}</p>}
          {alarm.causes.length > 0 && <Causes alarm={alarm} />}
          {alarm.inside_calibration !== null && <p>{alarm.inside_calibration ? t.inside : t.outside}</p>}
          <h2>{t.whatToDo}</h2>
          <ol>{advice(alarm, meaning, axis?.heat ?? null).map((words) => <li key={words}><bdi>{words}</bdi></li>)}</ol>
          {(alarm.recording !== null || alarm.report !== null || report) && <h2>{t.files}</h2>}
          <ul>
            {alarm.recording !== null && (
              <li><Frames name={alarm.recording} full /></li>
            )}
            {alarm.report !== null && <li><Report id={alarm.id} report={alarm.report} done={refresh} /></li>}
            {report && <li><a href={report}>{t.pages.report}</a></li>}
          </ul>
        </section>
      </div>
      <section>
        <h2>{t.history}</h2>
        <Transitions alarm={alarm} />
      </section>
      <p class="print-only quiet">axiswatch {live.service?.version}. {t.printed(stamp(Date.now()))}. {t.zone(zone())}</p>
    </article>
  );
}

/** State of the replay of its recording, which the daemon makes on request. */
function Report({ id, report, done }: { id: number | null; report: NonNullable<AlarmRecord["report"]>; done: () => Promise<void> }) {
  const [refusal, setRefusal] = useState("");
  const path = `/api/v1/alarms/${id}/report`;
  if (report.state === "made") return <Saved path={path} name={`alarm${id}.html`}>{t.replay.made}</Saved>;
  if (report.state === "running") return <>{t.replay.running}</>;
  const make = async (): Promise<void> => {
    setRefusal(await ask(path, {}).then(() => "", failure));
    await done();
  };
  const problem = refusal || report.problem;
  return (
    <>
      <button type="button" class="no-print" onClick={make}>{t.replay.make}</button>
      {problem && <small><Words by={report.sentences}>{problem}</Words></small>}
    </>
  );
}

function Causes({ alarm }: { alarm: AlarmRecord }) {
  return (
    <table role="table" aria-label={t.causes}>
      <thead><tr><th scope="col">{t.causes}</th><th scope="col">{t.probability}</th></tr></thead>
      <tbody>
        {alarm.causes.map((cause) => (
          <tr key={cause.parameter}>
            <td><bdi>{causeName(cause.parameter)}</bdi>{cause.alike.length > 0 && <small><bdi>{t.alike(cause.alike.map(causeName).join(", "))}</bdi></small>}</td>
            <td>{percent(cause.probability, false)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

const SENSOR = /^(torque|output) |^delay$/;
const PAYLOAD = /^(load|inertia)$/;
const FRICTION = /friction/i;
const HEAT = /gearbox/;

/** Advice for the state and the causes of an alarm; if the axis temperature is known, its friction is that at it. */
function advice(alarm: AlarmRecord, meaning: string, heat: Axis["heat"]): string[] {
  const words: string[] = [];
  if (["unacknowledged", "returned", "latched"].includes(alarm.state)) words.push(t.advice.acknowledge);
  if (alarm.kind === "forecast") return [...words, t.advice.forecast, t.advice.order];
  if (!alarm.active) return [...words, t.advice.gone];
  if (alarm.stage === "changed") return [...words, t.advice.wait];
  if (["model", "sign", "still"].includes(alarm.doubt)) return [...words, t.advice.sensor, t.advice.order];
  if (SENSOR.test(alarm.parameter)) words.push(t.advice.sensor);
  if (PAYLOAD.test(alarm.parameter) || alarm.same_payload.length > 0) words.push(t.advice.payload);
  words.push(t.advice.inspect(meaning ? `${alarm.parameter} (${meaningOf(meaning)})` : causeName(alarm.parameter)));
  const alike = alarm.causes.find((cause) => cause.parameter === alarm.parameter)?.alike ?? [];
  const others = alike.filter((cause) => !HEAT.test(cause));
  if (others.length < alike.length || (FRICTION.test(meaning) && heat === null)) words.push(t.advice.cold);
  if (others.length > 0) words.push(t.advice.inspectAlike(others.map(causeName).join(", ")));
  return [...words, t.advice.order];
}

function Transitions({ alarm }: { alarm: AlarmRecord }) {
  const { when, what, who, note } = t.transitions;
  const rows = alarm.transitions.map((step): Cells => [
    <Time at={step.at} />,
    stepText(step),
    <bdi>{whoName(step.who)}</bdi>,
    noteText(step) && <bdi>{noteText(step)}</bdi>,
  ]);
  return <Table label={t.history} columns={[when, what, who, note]} rows={rows} />;
}
