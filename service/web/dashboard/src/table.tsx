// A table, and what it shows asked for again from time to time.
import { useEffect, useState } from "preact/hooks";
import { ask } from "./ask";
import { count } from "./format";
import { failure } from "./sentences";
import { t } from "./texts";

const EVERY_MS = 10_000;
const MOST_ROWS = 50;

export type Cells = preact.ComponentChildren[];

/** Of many rows the first ones; the others behind a click, as they take a browser a while. */
export function Table({ label, columns, rows }: { label: string; columns: string[]; rows: Cells[] }) {
  const [all, setAll] = useState(false);
  const shown = all ? rows : rows.slice(0, MOST_ROWS);
  return (
    <div class="panel" role="region" aria-label={label} tabIndex={0}>
      <table role="table" aria-label={label}>
        <thead><tr>{columns.map((name) => <th key={name} scope="col">{name}</th>)}</tr></thead>
        <tbody>{shown.map((cells, i) => <tr key={i}>{cells.map((cell, k) => <td key={k}>{cell}</td>)}</tr>)}</tbody>
      </table>
      {shown.length < rows.length && (
        <p class="rest"><button type="button" class="plain" onClick={() => setAll(true)}>{t.more(rows.length - shown.length)}</button></p>
      )}
    </div>
  );
}

/** Counts that are not zero: "gated 1200, gap 2"; a reason has its name in the metrics as its title. */
export const reasons = (counts: Record<string, number>): Cells => {
  const found = Object.entries(counts).filter(([, n]) => n > 0);
  return [found.length === 0 ? "–" : found.map(([reason, n]) => <span key={reason} class="reason" title={reason}>{t.reason[reason] ?? reason.replaceAll("_", " ")} {count(n)}</span>)];
};

/** An answer, why there is none, and what asks at once; the last answer stays. */
export function usePolled<T>(path: string): [T | null, string, () => Promise<void>] {
  const [found, set] = useState<T | null>(null);
  const [problem, setProblem] = useState("");
  const load = async (): Promise<void> => {
    try {
      set(await ask<T>(path));
      setProblem("");
    } catch (error) {
      setProblem(failure(error));
    }
  };
  useEffect(() => {
    void load();
    const timer = setInterval(() => void load(), EVERY_MS);
    return () => clearInterval(timer);
  }, [path]);
  return [found, problem, load];
}
