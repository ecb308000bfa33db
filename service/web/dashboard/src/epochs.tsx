// The epochs of an axis: times and nominal values; start of a new one after a repair, or return to a former one.
import { useState } from "preact/hooks";
import { ActionForm } from "./action_form";
import type { Axis, Body } from "./ask";
import { moment } from "./format";
import { numberWithUnit, Time } from "./marks";
import { usePolled } from "./polled";
import { listed, noteText, whoName, Words } from "./sentences";
import { Table, type Cells } from "./table";
import { t } from "./texts";

export type Epoch = Body<"Epoch">;

/** "learning: 0.5 h of 2 h of operation", or nothing. */
export const epochWords = ({ epoch }: Axis): string =>
  epoch.state === "current" ? "" : (t.progress(epoch.state, epoch.done_s, epoch.length_s) ?? epoch.words);

/** The epochs of an axis, newest first; empty while they are not known. `now`: the one in force, if it is known. */
export function useEpochs(id: string, now: Axis["epoch"] | undefined): [Epoch[], () => Promise<void>] {
  const path = `/api/v1/axes/${encodeURIComponent(id)}/epochs`;
  const [found, , load] = usePolled<Body<"AxisEpochs">>(path, undefined, `${now?.number} ${now?.state}`);
  return [found?.epochs ?? [], load];
}

/** When the nominal values changed [s since 1970]: the first epoch changed none. */
export const changesOf = (epochs: Epoch[]): number[] =>
  epochs.filter((epoch) => epoch.in_force !== null && epoch.number > 1).map((epoch) => Date.parse(epoch.in_force ?? "") / 1000);

type Wanted = { action: "baseline" } | { action: "cancel" } | { action: "restore"; number: number };

export function Epochs({ axis, epochs, refresh }: { axis: Axis; epochs: Epoch[]; refresh: () => Promise<void> }) {
  const [wanted, want] = useState<Wanted | null>(null);
  const now = axis.epoch;
  const { number, state, source, since, who, values } = t.epochs.columns;
  const cellsOf = (epoch: Epoch): Cells => [
    String(epoch.number),
    <>{t.epochs.state[epoch.state]}{epoch.reason !== null && <small><Words by={epoch.sentences}>{epoch.reason}</Words></small>}</>,
    t.epochs.source[epoch.source],
    <>{epoch.in_force === null ? "–" : <Time at={epoch.in_force} />}{epoch.ended !== null && <small>{t.until(moment(epoch.ended))}</small>}</>,
    <bdi>{listed(whoName(epoch.who), noteText(epoch))}</bdi>,
    <>{epoch.values.map((v) => <Value key={v.name} v={v} by={epoch.sentences} />)}</>,
    ["closed", "rolled_back"].includes(epoch.state) && now.state !== "learning" && (
      <button type="button" onClick={() => want({ action: "restore", number: epoch.number })}>{t.epochs.restore}</button>
    ),
  ];
  return (
    <section aria-label={t.epochs.title}>
      <h2>{t.epochs.title}</h2>
      <p>
        {now.state === "learning"
          ? <button type="button" onClick={() => want({ action: "cancel" })}>{t.epochs.cancel}</button>
          : <button type="button" onClick={() => want({ action: "baseline" })}>{t.epochs.baseline}</button>}
        {" "}<bdi>{epochWords(axis)}</bdi>
      </p>
      <Table label={t.epochs.title} columns={[number, state, source, since, who, values, t.columns.action]} rows={epochs.map(cellsOf)}
        keys={epochs.map((epoch) => epoch.number)} />
      {wanted && (
        <EpochForm key={JSON.stringify(wanted)} {...{ axis, wanted, refresh }} close={() => want((now) => (now === wanted ? null : now))} />
      )}
    </section>
  );
}

function Value({ v, by }: { v: Epoch["values"][number]; by: Epoch["sentences"] }) {
  const before = v.former === null ? "" : ` (${t.epochs.before} ${numberWithUnit(v.former, v.unit)})`;
  return <div><bdi>{v.name}</bdi> = {numberWithUnit(v.value, v.unit)}{before}{v.kept !== null && <small><Words by={by}>{v.kept}</Words></small>}</div>;
}

/** The text of a chosen file; null: none was chosen. */
async function textOf(given: FormData, name: string): Promise<string | null> {
  const file = given.get(name);
  return file instanceof File && file.name !== "" ? file.text() : null;
}

function EpochForm({ axis, wanted, close, refresh }: { axis: Axis; wanted: Wanted; close: () => void; refresh: () => Promise<void> }) {
  const { action } = wanted;
  const [mode, setMode] = useState<"window" | "files">("window");
  const files = action === "baseline" && mode === "files";
  const path = action === "baseline" ? "baseline" : action === "cancel" ? "baseline/cancel" : `epochs/${wanted.number}/restore`;
  const body = async (given: FormData): Promise<Record<string, unknown>> => ({
    ...(files ? { mode, nominal: await textOf(given, "nominal"), thresholds: await textOf(given, "thresholds") }
      : action === "baseline" ? { mode, hours: Number(given.get("hours")) } : {}),
    ...(action === "cancel" ? {} : { verify_hours: Number(given.get("verify")) }),
  });
  const hours = (name: string, words: string, value: number) => (
    <label>{words}<input name={name} type="number" min="0.1" step="any" defaultValue={String(value)} required /></label>
  );
  return (
    <ActionForm label={t.epochs[action]} title={<><bdi>{axis.id}</bdi>{action === "restore" && ` (${wanted.number})`}</>}
      path={`/api/v1/axes/${encodeURIComponent(axis.id)}/${path}`} required={action !== "cancel"}
      confirm={action === "cancel" ? undefined : t.epochs.confirm[action]} body={body} close={close} done={refresh}>
      {action === "baseline" && (
        <label>{t.epochs.from}
          <select name="mode" value={mode} onChange={(event) => setMode(event.currentTarget.value as typeof mode)}>
            <option value="window">{t.epochs.source.window}</option>
            <option value="files">{t.epochs.source.files}</option>
          </select>
        </label>
      )}
      <p>{files ? t.epochs.fromFiles : t.epochs.meaning[action]}</p>
      {action === "baseline" && !files && hours("hours", t.epochs.hours, 2)}
      {files && <label>nominal.toml<input name="nominal" type="file" accept=".toml" required /></label>}
      {files && <label>{t.epochs.thresholds}<input name="thresholds" type="file" accept=".toml" /></label>}
      {action !== "cancel" && hours("verify", t.epochs.verify, 8)}
    </ActionForm>
  );
}
