// Frequency responses of the nominal and of the present model, with the resonances that have moved.
import { useState } from "preact/hooks";
import { ask, isSilence, type Axis, type Body } from "./ask";
import { number, percent, unit } from "./format";
import { Opened } from "./opened";
import { Plot, type Range } from "./plot";
import { useRepeated } from "./polled";
import { farthest, isMoved, signsOf } from "./resonances";
import { rangeOf, Z90 } from "./series";
import { t } from "./texts";

const EVERY_MS = 5000;
const AGAIN_MS = 500; // the first answer of a daemon may take longer than the page waits

export const BodePanel = ({ axis }: { axis: Axis }) => <Opened title={t.bode.title}><BodePlots axis={axis} /></Opened>;

function BodePlots({ axis }: { axis: Axis }) {
  const [bode, set] = useState<Body<"Bode"> | null>(null);
  const [failure, fail] = useState("");
  useRepeated(async () => {
    try {
      set(await ask<Body<"Bode">>(`/api/v1/axes/${encodeURIComponent(axis.id)}/bode`));
      return EVERY_MS;
    } catch (error) {
      fail(isSilence(error) ? "" : (error as Error).message); // the header says for how long there is no answer
      return isSilence(error) ? AGAIN_MS : EVERY_MS;
    }
  }, EVERY_MS);
  if (bode === null) return <p class="quiet">{failure || t.waiting}</p>;
  const f = bode.frequency_hz;
  const range: Range = [f[0] ?? 1, f.at(-1) ?? 100];
  const nothing = f.map(() => null);
  const moved = bode.resonances.filter(isMoved);
  const change = farthest(bode);
  const plot = { time: f, range, kind: "frequency" as const, signs: signsOf(bode.resonances) };
  const curves = (of: "magnitude_db" | "phase_deg") => [bode.nominal[of], bode.present?.[of] ?? nothing];
  const edges = (of: "magnitude_db" | "phase_deg", sd: (number | null)[]) => [-Z90, Z90].map((z) => f.map((_, i) => {
    const [value, one] = [bode.present?.[of][i] ?? null, sd[i] ?? null];
    return value === null || one === null ? null : value + z * one;
  }));
  const magnitude = t.bode.magnitude(unit(bode.unit.replace(" per N m", "/(N m)")));
  return (
    <>
      <p class="legend quiet">
        <span><i class="key dashes" /> {t.bode.nominal} ○</span>
        <span><i class="key up" /> {t.bode.present} ▲</span>
      </p>
      <ul class="facts">
        {bode.present === null && <li>{t.bode.none}</li>}
        {bode.without_estimate.length > 0 && <li>{t.bode.without(bode.without_estimate.join(", "))}</li>}
        {change !== null && <li>{t.bode.change(`${change.db > 0 ? "+" : ""}${number(change.db)} dB`, `${number(change.hz)} Hz`)}</li>}
        {moved.map((r) => (
          <li key={r.nominal_hz}>
            {t.bode.moved(`${number(r.nominal_hz)} Hz`, `${number(r.present_hz)} Hz`, percent((r.present_hz ?? 0) / (r.nominal_hz ?? 1) - 1))}
          </li>
        ))}
        {bode.present !== null && moved.length === 0 && <li>{t.bode.still}</li>}
      </ul>
      <h3>{magnitude}</h3>
      <Plot label={magnitude} height={190} {...plot} columns={[...edges("magnitude_db", bode.magnitude_sd_db), ...curves("magnitude_db")]} {...drawn} scale={rangeOf(curves("magnitude_db"))} />
      <h3>{t.bode.phase}</h3>
      <Plot label={t.bode.phase} height={140} {...plot} columns={[...edges("phase_deg", bode.phase_sd_deg), ...curves("phase_deg")]} {...drawn} scale={rangeOf(curves("phase_deg"))} />
    </>
  );
}

const EDGE = { colour: "none" };
const drawn = { lines: [EDGE, EDGE, { colour: "quiet", dash: [6, 4] }, { colour: "text" }], band: [0, 1] as [number, number] };
