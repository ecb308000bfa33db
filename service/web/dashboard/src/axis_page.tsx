// One axis: its alarms, its drive, and for each parameter the estimate and its test over one shared range of time.
import { useMemo, useState } from "preact/hooks";
import { AlarmTable, useAlarms } from "./alarm_list";
import type { Alarm, Axis, Parameter } from "./ask";
import { AxisService } from "./axis_service";
import { BodePanel } from "./bode_panel";
import { DriveChain } from "./drive_chain";
import { Meaning } from "./alarm_words";
import { changesOf, Epochs, epochWords, useEpochs } from "./epochs";
import { number, percent, span, withMargin } from "./format";
import { useHistory } from "./history";
import { ageOf, useLive } from "./live";
import { liveBuffer } from "./live_buffer";
import { deviationText, estimateText, kindOf, numberWithUnit, stateOf } from "./marks";
import { causeName, translated, Words } from "./sentences";
import { evidence } from "./need";
import { Plot, type Range } from "./plot";
import { SignalPanel } from "./signal_panel";
import { columnsOf, marksOf, rangeOf, Z90, type Columns, type History } from "./series";
import { t } from "./texts";
import { TimeRange, type Span } from "./time_range";
import { Trends } from "./trends";

export function AxisPage({ id }: { id: string }) {
  const live = useLive();
  const axis = live.axes.find((one) => one.id === id);
  const [shown, show] = useState<Span>({ length: 600, end: null });
  const now = newest(axis);
  const end = shown.end ?? now;
  const range: Range = [end - shown.length, end];
  const history = useHistory(id, range, shown.end === null);
  const [epochs, loadEpochs] = useEpochs(id, axis?.epoch);
  const changes = changesOf(epochs);
  const [alarms, refresh] = useAlarms(`axis=${encodeURIComponent(id)}`, 100);
  if (!axis) return <p class="quiet">{live.answered === null ? t.waiting : t.notThere(id)}</p>;
  const change = ([from, to]: Range): void => show({ length: to - from, end: to >= now ? null : to });
  const monitored = axis.parameters.map((p) => p.name);
  const shadow = axis.detectors.some((detector) => detector.name === "cusum" && !detector.alarms);
  return (
    <>
      <Head axis={axis} age={ageOf(axis, live)} />
      <AxisService axis={axis} />
      {alarms && alarms.alarms.some((alarm) => alarm.active) && (
        <section aria-label={t.axisAlarms}><AlarmTable alarms={alarms.alarms.filter((alarm) => alarm.active)} refresh={refresh} /></section>
      )}
      <DriveChain axis={axis} alarms={alarms?.alarms ?? []} />
      <SignalPanel key={id} axis={axis} />
      <BodePanel key={`${id} bode`} axis={axis} />
      <TimeRange span={shown} now={now} onChange={show}>
        <p class="legend quiet">
          <span><i class="key line" /> {t.legendEstimate}</span>
          <span><i class="key dashes" /> {t.legendNominal}</span>
          <span><i class="key up" /> {t.legendUp}</span>
          <span><i class="key down" /> {t.legendDown}</span>
          <span><i class="key threshold" /> {t.legendThreshold}</span>
          <span><i class="key alarm" /> {t.legendAlarm}</span>
          <span>{t.plotHelp}</span>
        </p>
        {inQuestionFirst(axis.parameters).map((p) => (
          <ParameterPanel key={p.name} {...{ p, id, history, range, monitored, changes, shadow }} alarms={alarms?.alarms ?? []} onRange={change} />
        ))}
      </TimeRange>
      <Trends id={id} />
      <Epochs axis={axis} epochs={epochs} refresh={loadEpochs} />
      <Facts axis={axis} />
      {alarms && alarms.alarms.some((alarm) => !alarm.active) && (
        <section>
          <h2>{t.axisAlarms}: {t.alarmFilter.ended}</h2>
          <AlarmTable alarms={alarms.alarms.filter((alarm) => !alarm.active)} refresh={refresh} />
        </section>
      )}
    </>
  );
}

/** Parameters with an alarm first. */
const inQuestionFirst = (parameters: Parameter[]): Parameter[] =>
  [...parameters].sort((a, b) => Number(b.status === "alarm") - Number(a.status === "alarm"));

/** The newest time [s since 1970]: that of the last sample, by the clock of the machine. */
function newest(axis: Axis | undefined): number {
  return axis?.last_sample ? Date.parse(axis.last_sample) / 1000 : Math.floor(Date.now() / 1000);
}

function Head({ axis, age }: { axis: Axis; age: number | null }) {
  const localised = (words: string): string => translated(words, axis.sentences) ?? words;
  const gate = localised(axis.gated_by ?? "");
  const notes = [
    ...t.notTestedSentences(axis, gate),
    ...(epochWords(axis) === "" ? [] : [epochWords(axis)]),
    ...(gate === "" ? [] : [t.paused(gate)]),
    ...axis.outside_calibration.map((words) => t.outsideCalibration(localised(words))),
  ];
  // Parameters that are not tested for that reason are named above.
  const isTold = (words: string): boolean => axis.sentences.some(({ words: own, kind, values }) => own === words && kind === "not observed"
    && axis.parameters.some((p) => p.name === values["name"] && p.not_tested_reason === "not observed"));
  const confounded = axis.confounded.filter((words) => !isTold(words));
  return (
    <div class="axis-head">
      <h1><bdi>{axis.id}</bdi></h1>
      <p class={axis.silent ? "late" : "quiet"}>{age === null ? t.noSample : t.lastSample(span(age))}</p>
      <p class="quiet"><bdi>{axis.model.drive}</bdi>, {t.output[axis.model.output] ?? axis.model.output} · {t.bus} <bdi>{axis.bus}</bdi></p>
      {(confounded.length > 0 || notes.length > 0) && (
        <ul class="banner warn" aria-label={`${t.notTested}: ${axis.id}`}>
          {notes.map((words) => <li key={words}><bdi>{words}</bdi></li>)}
          {confounded.map((words) => <li key={words}><Words by={axis.sentences}>{words}</Words></li>)}
        </ul>
      )}
    </div>
  );
}

interface PanelProps {
  p: Parameter;
  id: string;
  history: History | null;
  alarms: Alarm[];
  range: Range;
  monitored: string[];
  changes: number[];
  onRange: (range: Range) => void;
  /** Another detector raises the alarms. */
  shadow: boolean;
}

function ParameterPanel({ p, id, history, alarms, range, monitored, changes, onRange, shadow }: PanelProps) {
  // The history of the daemon is up to a minute behind, so that the end is what this page has received.
  const newestSeen = liveBuffer.after(id, 0).at(-1)?.time;
  const columns = useMemo(() => columnsOf(p.name, history, liveBuffer.after(id, 0)), [p.name, id, history, newestSeen]);
  const marks = useMemo(() => marksOf(alarms, p.name, monitored, range[0], range[1]), [alarms, p.name, range[0], range[1]]);
  // The colour of its own alarm, or of one without a parameter, which is drawn in all plots.
  const drawn = alarms.filter((alarm) => alarm.active && (alarm.parameter === p.name || !monitored.includes(alarm.parameter)));
  const active = drawn.find((alarm) => alarm.parameter === p.name) ?? drawn[0];
  const inside = within(columns, range);
  const half = p.tolerance ?? 0;
  const least: Range | null = p.nominal === null ? null : [p.nominal - half, p.nominal + half];
  return (
    <section class={`panel parameter ${kindOf(p)} prio-${active?.priority ?? "none"}`} aria-label={p.name}>
      <div class="figures">
        <h2><bdi>{p.name}</bdi> <small><Meaning of={p.meaning} /></small></h2>
        <Figures {...{ p, shadow }} />
      </div>
      <div class="plots">
        {inside === 0 && <p class="quiet">{t.noHistory}</p>}
        <Plot label={t.plotOf(p.name)} height={150} time={columns.time} {...{ range, marks, changes, onRange }}
          columns={[columns.low, columns.high, columns.nominal, columns.estimate]}
          lines={[{ colour: "none" }, { colour: "none" }, NOMINAL, ESTIMATE]} band={[0, 1]}
          scale={rangeOf(visible([columns.low, columns.high, columns.nominal, columns.estimate], columns, range), least)} />
        <Plot label={t.plotOfTest(p.name)} height={100} time={columns.time} {...{ range, marks, changes, onRange }}
          columns={[columns.time.map(() => 1), columns.up, columns.down]} lines={[THRESHOLD, UP, DOWN]}
          scale={rangeOf(visible([columns.up, columns.down], columns, range), [0, 1.1])} />
      </div>
    </section>
  );
}

const NOMINAL = { colour: "quiet", dash: [6, 4] };
const ESTIMATE = { colour: "text" };
const THRESHOLD = { colour: "alarm", dash: [2, 3], width: 1 };
const UP = { colour: "text" };
const DOWN = { colour: "quiet", dash: [8, 3] };

const within = ({ time, estimate }: Columns, [from, to]: Range): number =>
  time.filter((at, i) => at >= from && at <= to && estimate[i] !== null).length;

/** The parts of columns that lie in a range of time. */
const visible = (columns: (number | null)[][], { time }: Columns, [from, to]: Range): (number | null)[][] =>
  columns.map((column) => column.filter((_, i) => (time[i] ?? 0) >= from && (time[i] ?? 0) <= to));

function Figures({ p, shadow }: { p: Parameter; shadow: boolean }) {
  return (
    <dl>
      <dt>{t.state}</dt><dd><span class={`pill ${kindOf(p)}`}>{stateOf(p)}</span>{p.not_tested_reason && <small>{t.notTestedReason[p.not_tested_reason]}</small>}</dd>
      <dt>{t.estimate}</dt><dd>{estimateText(p)}</dd>
      <dt>{t.nominal}</dt><dd>{numberWithUnit(p.nominal, p.unit)}</dd>
      <dt>{t.deviation}</dt><dd class="share">{deviationText(p)}</dd>
      <dt>{t.tolerance}</dt><dd>± {numberWithUnit(p.tolerance, p.unit)}</dd>
      <dt>{t.test}</dt><dd>{t.ofThreshold(percent(evidence(p), false))}<small>▲ {number(p.cusum.up)} ▼ {number(p.cusum.down)} / {number(p.threshold)}</small>{shadow && <small>{t.testInShadow}</small>}</dd>
      <dt>{t.excitation}</dt><dd>{p.not_tested_reason === "no sample" ? "–" : t.observation[p.observation]}<small>{t.testedFor(span(p.tested_s ?? 0))}</small></dd>
    </dl>
  );
}

function Facts({ axis }: { axis: Axis }) {
  return (
    <section class="panel facts">
      <h2>{t.detectors}</h2>
      <ul>
        {axis.detectors.map((detector) => (
          <li key={detector.name}>
            {t.detector[detector.name] ?? detector.name}: {detector.alarms ? t.alarming : t.shadow}
            {detector.leading !== null && `; ${t.nearest(causeName(detector.leading), t.ofThreshold(percent(detector.evidence, false)))}`}
          </li>
        ))}
        {axis.heat !== null && <li>{t.heat(`${withMargin(axis.heat.heat_w, Z90 * (axis.heat.sd_w ?? 0))} W`)}</li>}
      </ul>
      <h2>{t.model}</h2>
      <p class="constants">
        {axis.model.nominal.map((c) => <span key={c.name}><bdi>{c.name}</bdi> = {numberWithUnit(c.value, c.unit)}</span>)}
      </p>
    </section>
  );
}
