// The last minutes of the axes as received by this page: the newest end of the plots.
import type { Axis, Parameter } from "./ask";

const LENGTH_S = 120; // the history of the daemon is up to a minute late

/** Numbers only: the objects of three hundred axes would fill the memory. */
export interface LivePoint {
  /** Time of the last sample [s since 1970]. */
  time: number;
  /** Names of the parameters. */
  names: string[];
  /** NUMBERS values of each parameter; NaN: there is none. */
  numbers: number[];
}

export const NUMBERS = 6;

const numbersOf = ({ estimate, standard_deviation, nominal, cusum, threshold }: Parameter): number[] =>
  [estimate, standard_deviation, nominal, cusum.up, cusum.down, threshold].map((x) => x ?? NaN);

class LiveBuffer {
  private readonly points = new Map<string, LivePoint[]>();

  /** Stores an axis, if its sample is newer than the last one stored. */
  add(axis: Axis): void {
    if (axis.last_sample === null) return;
    const time = Date.parse(axis.last_sample) / 1000;
    const kept = this.points.get(axis.id) ?? [];
    const last = kept.at(-1);
    // At most twice a second, and never backwards: after a clock was set back the buffer starts again.
    if (last && time > last.time && time < last.time + 0.5) return;
    if (last && time < last.time) kept.length = 0;
    if (last && time === last.time) return;
    const names = axis.parameters.map((p) => p.name);
    const same = last?.names.join() === names.join();
    kept.push({ time, names: last && same ? last.names : names, numbers: axis.parameters.flatMap(numbersOf).slice() }); // a slice has no spare room
    while ((kept[0]?.time ?? Infinity) < time - LENGTH_S) kept.shift();
    this.points.set(axis.id, kept);
  }

  /** The points of an axis after a time [s since 1970]. */
  after(id: string, time: number): LivePoint[] {
    return (this.points.get(id) ?? []).filter((point) => point.time > time);
  }
}

export const liveBuffer = new LiveBuffer();
