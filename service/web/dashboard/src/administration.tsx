// Information for administrators of the daemon: its configuration without secrets, and the log of changes.
import { useEffect, useState } from "preact/hooks";
import { ask, type Body } from "./ask";
import { alarmLink, axisLink, Time } from "./marks";
import { causeName, failure, noteText, whoName, Words } from "./sentences";
import { Table, type Cells } from "./table";
import { t } from "./texts";

export function Administration() {
  return (
    <>
      <Unfolded label={t.configuration.title}><Configuration /></Unfolded>
      <Unfolded label={t.audit.title}><Audit /></Unfolded>
    </>
  );
}

/** Requested when it is opened. */
function Unfolded({ label, children }: { label: string; children: preact.ComponentChildren }) {
  const [open, setOpen] = useState(false);
  return (
    <details class="unfolded" onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary><h2>{label}</h2></summary>
      {open && children}
    </details>
  );
}

/** An answer that is requested once, by `first`, and again by each call of `more`. */
function useAsked<T>(first: string): [T[], string, (path: string) => void] {
  const [found, set] = useState<T[]>([]);
  const [problem, setProblem] = useState("");
  const more = (path: string): void => {
    ask<T>(path).then((answer) => set((before) => [...before, answer]), (error) => setProblem(failure(error)));
  };
  useEffect(() => more(first), [first]);
  return [found, problem, more];
}

const Problem = ({ words }: { words: string }) => <p class="banner warn" role="alert"><Words>{words}</Words></p>;

function Configuration() {
  const [[found], problem] = useAsked<Body<"PublicConfiguration">>("/api/v1/system/configuration");
  if (problem) return <Problem words={problem} />;
  if (!found) return <p class="quiet">{t.waiting}</p>;
  return (
    <>
      <p class="quiet"><bdi>{found.file}</bdi>: {t.configuration.meaning}</p>
      <pre class="panel" tabIndex={0} aria-label={t.configuration.title}><bdi>{found.text}</bdi></pre>
    </>
  );
}

const PATH = "/api/v1/system/audit?limit=50";

function Audit() {
  const [pages, problem, more] = useAsked<Body<"Audit">>(PATH);
  if (problem) return <Problem words={problem} />;
  const last = pages.at(-1);
  if (!last) return <p class="quiet">{t.waiting}</p>;
  const rows = pages.flatMap((page) => page.changes).map(cellsOf);
  const { when, who, what, note } = t.transitions;
  if (rows.length === 0) return <p class="quiet">{t.audit.none}</p>;
  return (
    <>
      <Table label={t.audit.title} columns={[when, who, what, t.columns.axis, t.audit.subject, note]} rows={rows} />
      {last.next !== null && (
        <p><button type="button" onClick={() => more(`${PATH}&cursor=${encodeURIComponent(last.next ?? "")}`)}>{t.audit.older}</button></p>
      )}
    </>
  );
}

function cellsOf({ at, who, subject, event, axis, number, parameter, ...note }: Body<"AuditedChange">): Cells {
  return [
    <Time at={at} />,
    <bdi>{whoName(who)}</bdi>,
    t.event[event] ?? t.audit.event[event] ?? event,
    <a href={axisLink(axis)}><bdi>{axis}</bdi></a>,
    subject === "alarm" ? <a href={alarmLink(number)}>{t.alarmTitle(number)} <bdi>{causeName(parameter ?? "")}</bdi></a>
      : subject === "epoch" ? `${t.epochs.columns.number} ${number}` : t.audit.alarmsOfAxis,
    <bdi>{noteText(note) || "–"}</bdi>,
  ];
}
