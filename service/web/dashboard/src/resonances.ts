// Differences of the nominal and the present frequency response: shifted resonances, the largest change.
import type { Body } from "./ask";

type Resonance = Body<"Resonance">;

export interface Sign {
  at: number;
  mark: "○" | "▲";
}

const MOVED = 0.01; // of a frequency: less is scatter of the estimates
const CHANGED_DB = 0.1;

export const isMoved = ({ nominal_hz: was, present_hz: now }: Resonance): boolean =>
  was !== null && now !== null && Math.abs(now - was) > MOVED * was;

/** The resonances of the nominal model, and the shifted ones of the present model. */
export const signsOf = (resonances: Resonance[]): Sign[] =>
  resonances.flatMap((r): Sign[] => [
    ...(r.nominal_hz === null ? [] : [{ at: r.nominal_hz, mark: "○" as const }]),
    ...(r.present_hz !== null && (isMoved(r) || r.nominal_hz === null) ? [{ at: r.present_hz, mark: "▲" as const }] : []),
  ]);

/** Frequency of the largest difference of the magnitudes; null: there is hardly any. */
export function farthest(bode: Body<"Bode">): { hz: number; db: number } | null {
  let found: { hz: number; db: number } | null = null;
  bode.frequency_hz.forEach((hz, i) => {
    const [was, now] = [bode.nominal.magnitude_db[i] ?? null, bode.present?.magnitude_db[i] ?? null];
    if (was === null || now === null || Math.abs(now - was) <= Math.abs(found?.db ?? CHANGED_DB)) return;
    found = { hz, db: now - was };
  });
  return found;
}
