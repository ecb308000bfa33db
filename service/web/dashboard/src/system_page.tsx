// The daemon itself: its load, buses, dropped values and reasons, files, clocks, recordings, versions.
import { useRef, useState } from "preact/hooks";
import { Administration } from "./administration";
import { LoadFigures } from "./alarm_frequency";
import { Frames } from "./alarm_list";
import { ask, type Axis, type Body, type Service } from "./ask";
import { count, number, percent, size, span } from "./format";
import { useLive, type Live } from "./live";
import { axisLink, Time } from "./marks";
import { usePolled } from "./polled";
import { failure, Words } from "./sentences";
import { reasons, Table, type Cells } from "./table";
import { t } from "./texts";

export function SystemPage() {
  const live = useLive();
  const [system] = usePolled<Body<"System">>("/api/v1/system");
  const { service } = live;
  if (service === null) return <p class="quiet">{t.waiting}</p>;
  return (
    <>
      <h1>{t.system}</h1>
      <div class="columns">
        <section class="panel">
          <h2>{t.theDaemon}</h2>
          <dl>
            <dt>{t.version}</dt><dd>{service.version}</dd>
            <dt>{t.started}</dt><dd><Time at={service.started} /></dd>
            <dt>{t.running}</dt><dd>{span((Date.parse(service.taken) - Date.parse(service.started)) / 1000)}</dd>
            <dt>{t.checkpoint}</dt><dd>{service.checkpoint === null ? t.none : <Time at={service.checkpoint} />}</dd>
            <dt>{t.answerTime}</dt><dd>{live.took === null ? "–" : `${live.took} ms`}</dd>
          </dl>
          <p class="after"><a href="#/system/commissioning">{t.commissioning.title}</a></p>
        </section>
        {system !== null && <Process system={system} />}
        <Load />
      </div>
      <h2>{t.buses}</h2>
      <Buses live={live} />
      {service.links.length > 0 && <Links {...service} />}
      {system !== null && <Databases {...{ system, service }} />}
      <h2>{t.dropsAxis}</h2>
      <Table label={t.dropsAxis} columns={[t.columns.axis, t.samples, t.used, t.notUsed, t.dropped]} rows={live.axes.map(samplesOf)} />
      <h2>{t.clocks}</h2>
      <Table label={t.clocks} columns={[t.columns.axis, t.clock, t.interval, t.scatter, t.restarts]} rows={live.axes.map(clockOf)} />
      <Recordings />
      <Administration />
    </>
  );
}

function Buses({ live }: { live: Live }) {
  // Frames per second, between two answers.
  const before = useRef<{ taken: number; frames: Map<string, number> } | null>(null);
  const rates = useRef(new Map<string, number>());
  const { service } = live;
  if (service === null) return null;
  const taken = Date.parse(service.taken) / 1000;
  const last = before.current;
  if (last === null || taken > last.taken) {
    if (last !== null) {
      for (const { name, frames } of service.buses) {
        rates.current.set(name, (frames - (last.frames.get(name) ?? frames)) / (taken - last.taken));
      }
    }
    before.current = { taken, frames: new Map(service.buses.map(({ name, frames }) => [name, frames])) };
  }
  const rows = service.buses.map((bus): Cells => {
    const rate = rates.current.get(bus.name);
    return [
      <bdi>{bus.name}</bdi>,
      <span class={bus.up ? "" : "pill warn"}>{bus.up ? t.up : <Words by={service.sentences}>{bus.state}</Words>}</span>,
      t.readerKind[bus.reader] ?? (bus.reader || "–"),
      count(bus.frames),
      rate === undefined ? "–" : count(Math.round(rate)),
      reasons(bus.dropped),
    ];
  });
  return <Table label={t.buses} columns={[t.bus, t.columns.state, t.reader, t.received, t.rate, t.dropped]} rows={rows} />;
}

function Links({ links, sentences }: Pick<Body<"Service">, "links" | "sentences">) {
  const { connected, problem, pending, delivered, givenUp } = t.links;
  const rows = links.map((link): Cells => [
    <><bdi>{link.name}</bdi> ({link.kind})</>,
    <span class={link.connected ? "" : "pill warn"}>{link.connected ? connected : problem}</span>,
    link.problem === null ? "–" : <Words by={sentences}>{link.problem}</Words>,
    count(link.pending),
    count(link.delivered),
    reasons(link.given_up),
  ]);
  return (
    <>
      <h2>{t.links.title}</h2>
      <Table label={t.links.title} columns={[t.links.link, t.columns.state, t.links.why, pending, delivered, givenUp]} rows={rows} />
    </>
  );
}

const Name = ({ id }: { id: string }) => <a href={axisLink(id)}><bdi>{id}</bdi></a>;

function samplesOf(axis: Axis): Cells {
  const { used = 0, seeding = 0, projected: _, ...others } = axis.counters; // used, too, is a sample at which a bound held an estimate
  return [<Name id={axis.id} />, count(axis.samples), count(used + seeding), reasons(others), reasons(axis.dropped)];
}

function clockOf(axis: Axis): Cells {
  const { clock, interval_s, scatter_s } = axis.stamps;
  const ms = (s: number | null): string => (s === null ? "–" : `${number(s * 1000)} ms`);
  return [<Name id={axis.id} />, t.clockKind[clock] ?? clock, ms(interval_s), ms(scatter_s), reasons(axis.clock)];
}

/** Processor time between two answers, memory, and the build of the daemon. */
function Process({ system }: { system: Body<"System"> }) {
  const before = useRef(system);
  const shown = useRef<number | null>(null);
  const passed = system.uptime_s - before.current.uptime_s;
  if (passed > 0) shown.current = (system.cpu_s - before.current.cpu_s) / passed;
  before.current = system;
  return (
    <section class="panel">
      <h2>{t.process.title}</h2>
      <dl>
        <dt>{t.process.cpu}</dt><dd>{shown.current === null ? "–" : t.process.ofCore(percent(shown.current, false), system.cores)}</dd>
        <dt>{t.process.memory}</dt><dd>{system.memory_bytes === null ? "–" : size(system.memory_bytes)}</dd>
        <dt>{t.process.disk}</dt><dd>{system.free_bytes === null ? "–" : size(system.free_bytes)}</dd>
        <dt>{t.process.versions}</dt><dd>{Object.entries(system.versions).map((words) => words.join(" ")).join(", ")}</dd>
      </dl>
    </section>
  );
}

function Databases({ system, service }: { system: Body<"System">; service: Service }) {
  const d = t.databases;
  const rows = system.databases.map(({ name, size_bytes, written, problem }): Cells => [
    <><bdi>{name}</bdi>{d.holds[name] && <small>{d.holds[name]}</small>}</>,
    size(size_bytes),
    written === null ? t.none : <Time at={written} />,
    problem === null ? d.fine : <span class="pill warn"><Words by={service.sentences}>{problem}</Words></span>,
  ]);
  return (
    <>
      <h2>{d.title}</h2>
      <Table label={d.title} columns={[t.file, t.fileSize, d.written, t.columns.state]} rows={rows} />
      {system.damaged.length > 0 && <p class="banner warn">{d.damaged} <bdi>{system.damaged.join(", ")}</bdi></p>}
    </>
  );
}

function Load() {
  const [found] = usePolled<Body<"AlarmStatistics">>("/api/v1/alarms/statistics");
  return (
    <section class="panel">
      <h2>{t.load}</h2>
      {found === null ? <p class="quiet">{t.waiting}</p> : <dl><LoadFigures found={found} /></dl>}
    </section>
  );
}

function Recordings() {
  const [found, , load] = usePolled<Body<"Recordings">>("/api/v1/recordings");
  const [problem, setProblem] = useState("");
  const record = async (): Promise<void> => {
    try {
      await ask("/api/v1/recordings", {});
      setProblem("");
      await load();
    } catch (error) {
      setProblem(failure(error));
    }
  };
  const rows = [...(found?.recordings ?? [])].reverse().map(({ name, size_bytes }): Cells => [
    <Frames name={name} full />, size(size_bytes),
  ]);
  return (
    <section>
      <h2>{t.recordings}</h2>
      <p><button type="button" onClick={() => void record()}>{t.recordNow}</button></p>
      {problem && <p class="banner bad" role="alert"><Words>{problem}</Words></p>}
      {rows.length === 0 ? <p class="quiet">{t.noRecording}</p> : <Table label={t.recordings} columns={[t.file, t.fileSize]} rows={rows} />}
    </section>
  );
}
