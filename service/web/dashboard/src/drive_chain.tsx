// The drive as a chain: symbols of its components with their parameters; a component with an alarm is marked.
import { useEffect, useState } from "preact/hooks";
import { ask, type Alarm, type Axis, type Parameter } from "./ask";
import { chainOf, monitoredIn, placeless, type Component, type DriveModel, type Row, type Shaft } from "./chain";
import { AlarmMark, deviationText, kindOf, numberWithUnit, stateOf } from "./marks";
import { t } from "./texts";

interface Props {
  axis: Axis;
  alarms: Alarm[];
}

export function DriveChain({ axis, alarms }: Props) {
  const [model, set] = useState<DriveModel | null>(null);
  // Another drive or epoch has another model.
  const key = JSON.stringify([axis.id, axis.model]);
  useEffect(() => {
    let dropped = false;
    ask<DriveModel>(`/api/v1/axes/${encodeURIComponent(axis.id)}/model`).then((found) => dropped || set(found)).catch(() => dropped || set(null));
    return () => {
      dropped = true;
    };
  }, [key]);
  if (model === null) return null;
  const rows = chainOf(model.components);
  const outside = placeless(model);
  const label = (name: string) => <Label key={name} p={axis.parameters.find((p) => p.name === name)} name={name} alarms={alarms} />;
  const part = (c: Component) => <Part key={c.name} {...{ c, axis, model, alarms }} />;
  return (
    <section class="panel drive" aria-label={t.drive.title}>
      <h2>{t.drive.title} <small><bdi>{model.drive}</bdi></small></h2>
      <p class="legend quiet">{t.drive.legend}</p>
      {rows.map((row, i) => (
        <div key={i}>
          {row.from !== null && <p class="quiet">{t.drive.branch(nameOf(row.from))}</p>}
          <Chain row={row} part={part} />
        </div>
      ))}
      {outside.length > 0 && <div class="outside"><p class="quiet">{t.drive.outside}</p>{outside.map(label)}</div>}
    </section>
  );
}

const nameOf = (shaft: Shaft): string => [...shaft.masses, ...shaft.attached][0]?.name ?? "–";

function Chain({ row, part }: { row: Row; part: (c: Component) => preact.JSX.Element }) {
  return (
    <ol class="chain">
      {row.stages.flatMap(({ links, shaft }, i) => [
        links.length > 0 && <li key={`l${i}`} class="link">{links.map(part)}</li>,
        <li key={`s${i}`} class={shaft.masses.length + shaft.attached.length > 0 ? "shaft" : "shaft bare"}>
          {shaft.masses.length > 0 ? shaft.masses.map(part) : <Symbol kind="shaft" />}
          {shaft.attached.length > 0 && <ul>{shaft.attached.map((c) => <li key={c.name}>{part(c)}</li>)}</ul>}
        </li>,
      ])}
    </ol>
  );
}

function Part({ c, axis, model, alarms }: Props & { c: Component; model: DriveModel }) {
  const monitored = monitoredIn(c, model);
  // A sensor is drawn according to its measured quantity; the library has its drives with one of them.
  const kind = c.kind.endsWith("-sensor") ? (axis.model.output === "angle" ? "angle-sensor" : "speed-sensor") : c.kind;
  const found = monitored.map((name) => axis.parameters.find((p) => p.name === name));
  const out = found.find((p) => p?.status === "alarm");
  const active = alarms.find((alarm) => alarm.active && alarm.parameter === out?.name);
  const own = new Set(model.monitored.filter((m) => monitored.includes(m.name)).flatMap((m) => m.names));
  const others = c.parameters.filter((p) => p.names.length > 0 && !p.names.every((name) => own.has(name)));
  const valueOf = (name: string): string => {
    const known = axis.model.nominal.find((constant) => constant.name === name);
    return known === undefined ? "" : ` ${numberWithUnit(known.value, known.unit)}`;
  };
  return (
    <div class={`part ${out ? `out prio-${active?.priority ?? "none"}` : ""}`}>
      <Symbol kind={kind} />
      <small>{t.drive.kind[kind] ?? kind}</small>
      {monitored.map((name, i) => <Label key={name} p={found[i]} name={name} alarms={alarms} />)}
      {others.map((p) => <span key={p.role} class="fixed"><bdi>{p.text}</bdi>{valueOf(p.text)}</span>)}
    </div>
  );
}

/** A monitored parameter: its name and state, in an alarm with the mark of its priority. */
function Label({ p, name, alarms }: { p: Parameter | undefined; name: string; alarms: Alarm[] }) {
  const active = alarms.find((alarm) => alarm.active && alarm.parameter === name);
  const alarm = p?.status === "alarm";
  return (
    <span class={`watched ${p ? kindOf(p) : ""} prio-${active?.priority ?? "none"}`}>
      {active && <AlarmMark alarm={active} />}
      <b><bdi>{name}</bdi></b>{p && p.status !== "waiting" && <> <span class="nowrap">{deviationText(p)}</span></>}
      {p && (alarm || !p.tested) && <em>{stateOf(p)}</em>}
    </span>
  );
}

/** Masses and connections of two shafts are on the line of the shaft at half the height; the others hang below it. */
const SYMBOLS: Record<string, string> = {
  shaft: "M-22 22H94",
  inertia: "M-22 22H18M18 5H54V39H18ZM54 22H94",
  spring: "M-22 22H12L16 12 24 32 32 12 40 32 48 12 56 32 60 22H94",
  damper: "M-22 22H30M30 12V32M24 8H46V36H24M46 22H94",
  "spring-damper": "M-22 22H8M8 11V33M8 11H14L18 4 25 18 32 4 39 18 46 4 53 18 57 11H64V33M8 33H32M32 27V39M26 24H46V42H26M46 33H64M64 22H94",
  "ideal-gear": "M-22 22H27M21 4H33V22H21ZM39 14H51V40H39ZM51 27H60V22H94M21 22V40H33V22",
  "viscous-friction": "M36 0V16M28 16H44M24 10V28H48V10M36 28V36M22 36H50M26 36 20 43M36 36 30 43M46 36 40 43",
  "coulomb-friction": "M36 0V14M24 14H48V28H24ZM16 30H56M22 30 16 38M34 30 28 38M46 30 40 38M56 30 50 38",
  gravity: "M36 0V12M26 12H46V26H26ZM36 26V42M30 35 36 42 42 35",
  "torque-offset": "M36 0V10M22 32A15 15 0 1 1 50 32M50 32 44 30M50 32 53 25",
  torque: "M36 0V6M18 24A18 18 0 1 1 54 24A18 18 0 1 1 18 24M28 32V17L36 27 44 17V32",
  "speed-sensor": "M36 0V8M20 24A16 16 0 1 1 52 24A16 16 0 1 1 20 24M36 24 45 14",
  "angle-sensor": "M36 0V8M20 24A16 16 0 1 1 52 24A16 16 0 1 1 20 24M36 24H50M36 24 46 13",
  gain: "M24 6 52 22 24 38ZM10 22H24M52 22H64",
};

const Symbol = ({ kind }: { kind: string }) => (
  <svg class="symbol" viewBox={(SYMBOLS[kind] ?? "").startsWith("M-22") ? "-22 0 116 44" : "0 0 72 44"} aria-hidden="true">
    <path d={SYMBOLS[kind] ?? SYMBOLS.shaft} />
  </svg>
);
