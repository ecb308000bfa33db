// A table, and counts by their reasons in its cells.
import { useState } from "preact/hooks";
import { count } from "./format";
import { t } from "./texts";

const MOST_ROWS = 50;

export type Cells = preact.ComponentChildren[];

interface TableProps {
  label: string;
  columns: string[];
  rows: Cells[];
  /** Key of the rows if they move; default: their number. */
  keys?: (string | number)[];
  /** A class of the table, and of each row. */
  kind?: string;
  tones?: string[];
  /** Number of rows at first; the others appear after a click, since a browser needs time for them. */
  most?: number;
}

/** On a phone each row is a card, with the names of the columns in it. Roles: displayed so, a table is none to a screen reader. */
export function Table({ label, columns, rows, keys = [], kind = "", tones = [], most = MOST_ROWS }: TableProps) {
  const [all, setAll] = useState(false);
  const shown = all ? rows : rows.slice(0, most);
  const isEmpty = (cell: Cells[number]): boolean => cell === "" || cell === null || cell === false;
  return (
    <div class="panel" role="region" aria-label={label} tabIndex={0}>
      <table class={`stacked ${kind}`} role="table" aria-label={label}>
        <thead role="rowgroup"><tr role="row">{columns.map((name) => <th key={name} role="columnheader" scope="col">{name}</th>)}</tr></thead>
        <tbody role="rowgroup">
          {shown.map((cells, i) => (
            <tr key={keys[i] ?? i} role="row" class={tones[i]}>
              {cells.map((cell, k) => <td key={k} role="cell" data-label={isEmpty(cell) ? undefined : columns[k]}>{cell}</td>)}
            </tr>
          ))}
        </tbody>
      </table>
      {shown.length < rows.length && (
        <p class="rest"><button type="button" class="plain" onClick={() => setAll(true)}>{t.more(rows.length - shown.length)}</button></p>
      )}
    </div>
  );
}

/** Nonzero counts: "gated 1200, gap 2"; the title of a reason is its name in the metrics. */
export const reasons = (counts: Record<string, number>): Cells => {
  const found = Object.entries(counts).filter(([, n]) => n > 0);
  return [found.length === 0 ? "–" : found.map(([reason, n]) => <span key={reason} class="reason" title={reason}>{t.reason[reason] ?? reason.replaceAll("_", " ")} {count(n)}</span>)];
};
