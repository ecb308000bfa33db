// Torque, motion, its prediction and the prediction error over the last seconds; requested while the panel is open.
import { useRef, useState } from "preact/hooks";
import { ask, isSilence, type Axis } from "./ask";
import { number, unit } from "./format";
import { Opened } from "./opened";
import { Plot, type Range } from "./plot";
import { useRepeated } from "./polled";
import { rangeOf } from "./series";
import { emptySignals, joined, LENGTH_S, type SignalColumns, type Signals } from "./signal_buffer";
import { t } from "./texts";

const EVERY_MS = 1000;

interface Shown {
  columns: SignalColumns;
  limit: number | null;
  unit: string;
  failure: string;
}

const NOTHING: Shown = { columns: emptySignals(), limit: null, unit: "", failure: "" };

function useSignals(id: string): Shown {
  const [shown, set] = useState(NOTHING);
  const end = useRef<string | null>(null);
  useRepeated(async () => {
    const since = end.current === null ? "" : `?since=${encodeURIComponent(end.current)}`;
    try {
      const answer = await ask<Signals>(`/api/v1/axes/${encodeURIComponent(id)}/signals${since}`);
      end.current = answer.end ?? end.current;
      set(({ columns }) => ({ columns: joined(columns, answer), limit: answer.outlier_limit, unit: answer.unit, failure: "" }));
    } catch (error) {
      set((before) => ({ ...before, failure: isSilence(error) ? "" : (error as Error).message }));
    }
    return EVERY_MS;
  }, EVERY_MS);
  return shown;
}

export const SignalPanel = ({ axis }: { axis: Axis }) => <Opened title={t.signals.title}><LastSeconds axis={axis} /></Opened>;

function LastSeconds({ axis }: { axis: Axis }) {
  const { columns: c, limit, unit: of, failure } = useSignals(axis.id);
  const end = c.time.at(-1);
  if (end === undefined) return <p class="quiet">{failure || t.signals.waiting}</p>;
  const range: Range = [end - LENGTH_S, end];
  const plot = { time: c.time, range };
  const level = (x: number | null): (number | null)[] => c.time.map(() => x);
  return (
    <>
      <p class="legend quiet">
        <span><i class="key up" /> {t.signals.measured}</span>
        <span><i class="key dashes predicted" /> {t.signals.predicted}</span>
        {limit !== null && <span><i class="key threshold" /> {t.signals.limit(`± ${number(limit)} ${unit(of)}`)}</span>}
        <span><i class="key point" /> {t.signals.passed}</span>
      </p>
      <h3>{t.signals.torque}</h3>
      <Plot label={t.signals.torque} height={130} {...plot} columns={[c.torque]} lines={[MEASURED]} scale={rangeOf([c.torque])} />
      <h3>{t.signals.motion(unit(of))}</h3>
      <Plot label={t.signals.motion(unit(of))} height={130} {...plot} columns={[c.measured, c.predicted]} lines={[MEASURED, PREDICTED]}
        scale={rangeOf([c.measured, c.predicted])} />
      <h3>{t.signals.error(unit(of))}</h3>
      <Plot label={t.signals.error(unit(of))} height={130} {...plot}
        columns={[level(limit), level(limit === null ? null : -limit), c.error, c.passed]} lines={[LIMIT, LIMIT, MEASURED, PASSED]}
        scale={rangeOf([c.error], limit === null ? null : [-limit, limit])} />
    </>
  );
}

const MEASURED = { colour: "text", width: 1 };
const PREDICTED = { colour: "predicted", dash: [6, 4] };
const LIMIT = { colour: "alarm", dash: [2, 3], width: 1 };
const PASSED = { colour: "alarm", points: true };
