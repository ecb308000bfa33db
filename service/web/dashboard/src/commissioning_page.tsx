// Progress of commissioning: first a live check of the signals of each axis, then the steps, reports and commands.
import { useRef, useState } from "preact/hooks";
import { ask, type Body } from "./ask";
import { number, percent } from "./format";
import { axisLink } from "./marks";
import { usePolled } from "./polled";
import { failure, Words } from "./sentences";
import { Table, type Cells } from "./table";
import { t } from "./texts";

type Check = Body<"SignalCheck">;

export function CommissioningPage() {
  const [found, problem] = usePolled<Body<"Commissioning">>("/api/v1/commissioning");
  const c = t.commissioning;
  if (found === null) return <p class="quiet">{problem ? <Words>{problem}</Words> : t.waiting}</p>;
  const next = found.steps.find((step) => step.name === found.next);
  return (
    <>
      <h1>{c.title}</h1>
      <p class="banner">
        {next ? <>{c.next[next.name]} <code>{next.command}</code></> : c.complete}
      </p>
      <Signals axes={found.axes} />
      <h2>{c.steps}</h2>
      <p class="quiet">{c.folder} <bdi>{found.folder ?? c.ofConfiguration}</bdi></p>
      <Table label={c.steps} columns={[c.step, t.columns.state, c.command]} rows={found.steps.map((step) => stepOf(step, found.next))} />
      <h2>{c.results}</h2>
      {found.report !== null && <p><a href={found.report}>{t.pages.report}</a></p>}
      <Table label={c.results} columns={[t.columns.axis, c.nominal, c.thresholds, c.motion]} rows={found.axes.map(resultsOf)} />
    </>
  );
}

function stepOf({ name, done, total, command }: Body<"CommissioningStep">, next: string | null): Cells {
  const state = total === null ? t.commissioning.records(done) : t.commissioning.axes(done, total);
  return [
    t.commissioning.name[name],
    <span class={name === next ? "pill warn" : ""}>{state}</span>,
    <code>{command}</code>,
  ];
}

function resultsOf({ axis, identified, calibrated, identification, calibration, motion }: Body<"AxisCommissioning">): Cells {
  const c = t.commissioning;
  const cell = (done: boolean, report: string | null, words: string) => (
    <>{done ? c.done : c.open}{report !== null && <> (<a href={report} aria-label={`${c.report}: ${words}, ${axis}`}>{c.report}</a>)</>}</>
  );
  return [
    <a href={axisLink(axis)}><bdi>{axis}</bdi></a>,
    cell(identified, identification, c.nominal),
    cell(calibrated, calibration, c.thresholds),
    motion === null ? "–" : <bdi>{motion}</bdi>,
  ];
}

/** One axis after the other, so that the daemon never checks more than one. */
function Signals({ axes }: { axes: Body<"AxisCommissioning">[] }) {
  const c = t.commissioning;
  const [checks, setChecks] = useState<Record<string, Check | string>>({});
  const [running, setRunning] = useState<string | null>(null);
  const wanted = useRef(false);
  const check = async (ids: string[]): Promise<void> => {
    wanted.current = true;
    for (const id of ids) {
      if (!wanted.current) break;
      setRunning(id);
      const found = await ask<Check>(`/api/v1/commissioning/${encodeURIComponent(id)}/signals`, null, 25_000).catch(failure);
      setChecks((before) => ({ ...before, [id]: found }));
    }
    wanted.current = false;
    setRunning(null);
  };
  const stop = (): void => {
    wanted.current = false;
  };
  const rows = axes.flatMap(({ axis }) => (checks[axis] === undefined ? [] : [checkOf(axis, checks[axis], () => void check([axis]), running !== null)]));
  return (
    <>
      <h2>{c.signals}</h2>
      <p class="quiet">{c.meaning}</p>
      <div class="tools">
        <button type="button" disabled={running !== null} onClick={() => void check(axes.map(({ axis }) => axis))}>{c.check}</button>
        {running !== null && <button type="button" onClick={stop}>{c.stop}</button>}
        <span role="status">{running === null ? "" : <>{c.checking} <bdi>{running}</bdi></>}</span>
      </div>
      {rows.length > 0 && (
        <Table label={c.signals} rows={rows}
          columns={[t.columns.axis, c.rate, t.scatter, c.missing, c.torque, c.motionRange, c.findings]} />
      )}
    </>
  );
}

function checkOf(axis: string, check: Check | string | undefined, again: () => void, busy: boolean): Cells {
  const name = (
    <><a href={axisLink(axis)}><bdi>{axis}</bdi></a><small><button type="button" class="plain" disabled={busy} onClick={again}
      aria-label={`${t.commissioning.again}: ${axis}`}>{t.commissioning.again}</button></small></>
  );
  if (check === undefined || typeof check === "string") return [name, "", "", "", "", "", <Words>{check ?? ""}</Words>];
  const [torque, motion] = check.signals;
  return [
    name,
    number(check.rate_hz),
    check.scatter_s === null ? "–" : `${number(check.scatter_s * 1000)} ms`,
    percent(check.missing, false),
    torque ? rangeOf(torque) : "–",
    motion ? rangeOf(motion) : "–",
    <Findings check={check} />,
  ];
}

const rangeOf = ({ signal, unit, low, high }: Body<"SignalRange">) => (
  <><span class="nowrap">{number(low)} … {number(high)} {unit}</span><small><bdi>{signal}</bdi></small></>
);

function Findings({ check }: { check: Check }) {
  const c = t.commissioning;
  const all: [string, string[]][] = [[c.problem, check.problems], [c.proposal, check.proposals], [c.doubt, check.doubts]];
  if (all.every(([, words]) => words.length === 0)) return <>{check.moves === false ? c.stands : c.fine}</>;
  return (
    <ul class="findings">
      {all.flatMap(([kind, words]) => words.map((sentence) => (
        <li key={sentence}><b class={kind === c.problem ? "pill warn" : "pill"}>{kind}</b> <Words by={check.sentences}>{sentence}</Words></li>
      )))}
    </ul>
  );
}
