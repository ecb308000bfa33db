// The history of an axis for the shown range of time, requested again when the range moves.
import { useEffect, useState } from "preact/hooks";
import { ask } from "./ask";
import type { History } from "./series";

const POINTS = 800;
const SHORTEST_WAIT_S = 10; // the daemon keeps a point each ten seconds
const MARGIN = 0.5; // of the range on each side, so that a small move needs no answer

/** The history in a range [s since 1970]; null: not known yet. `live`: the end of the range is the newest time. */
export function useHistory(id: string, [from, to]: [number, number], live: boolean): History | null {
  const [history, set] = useState<History | null>(null);
  const length = to - from;
  // A range that follows the newest time is requested when it has moved by a point; another range at once.
  const wait = Math.max(SHORTEST_WAIT_S, length / POINTS);
  const key = live ? `${id} ${length} ${Math.floor(to / wait)}` : `${id} ${from} ${to}`;
  useEffect(() => {
    let dropped = false;
    const timer = setTimeout(() => {
      void load(id, from - MARGIN * length, live ? null : to + MARGIN * length).then((found) => {
        if (found && !dropped) set(found);
      });
    }, live ? 0 : 150);
    return () => {
      dropped = true;
      clearTimeout(timer);
    };
  }, [key]);
  useEffect(() => () => set(null), [id]);
  return history;
}

const iso = (s: number): string => new Date(s * 1000).toISOString();

async function load(id: string, since: number, until: number | null): Promise<History | null> {
  const query = new URLSearchParams({ since: iso(since), points: String(POINTS) });
  if (until !== null) query.set("until", iso(until));
  try {
    return await ask<History>(`/api/v1/axes/${encodeURIComponent(id)}/history?${query}`);
  } catch {
    return null; // too many readers at once, or no answer: what is shown stays, and it is asked for again
  }
}
