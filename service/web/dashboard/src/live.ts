// The present state of the daemon: polled each second; axes from its events if it has them. Pages subscribe.
import { useEffect, useState } from "preact/hooks";
import { allowReports, ask, isSilence, TokenNeeded, type Alarm, type Axis, type Body, type Service } from "./ask";
import { Follower } from "./events";
import { liveBuffer } from "./live_buffer";
import { failure } from "./sentences";

const EVERY_MS = 1000;
const EVERY_HIDDEN_MS = 10_000;
const STALE_MS = 3000;
const ACTIVE = "/api/v1/alarms?active=true&limit=1000";

export interface Live {
  service: Service | null;
  axes: Axis[];
  /** Time of arrival of each axis [ms], from which its age is counted. */
  arrived: Map<string, number>;
  active: Alarm[];
  activeTotal: number;
  /** Time of the last complete answer [ms]; null: none yet. */
  answered: number | null;
  /** Time from request to answer [ms]. */
  took: number | null;
  /** Reason why there is no answer; empty: there is one. */
  failure: string;
  /** Reason why a token is needed; null: none is needed. */
  locked: string | null;
  now: number;
}

let state: Live = {
  service: null, axes: [], arrived: new Map(), active: [], activeTotal: 0, answered: null, took: null,
  failure: "", locked: null, now: Date.now(),
};
const listeners = new Set<() => void>();
const begun = Date.now();

function set(changes: Partial<Live>): void {
  state = { ...state, ...changes, now: Date.now() };
  for (const listener of listeners) listener();
}

/** Time without an answer [s]; null: there are answers. */
export function silence(live: Live): number | null {
  const since = live.now - (live.answered ?? begun);
  const failed = live.failure !== "" && live.answered === null;
  return since > STALE_MS || failed ? since / 1000 : null;
}

/** The age of the last sample of an axis now [s]; null: there is none. */
export function ageOf(axis: Axis, live: Live): number | null {
  const arrived = live.arrived.get(axis.id) ?? live.now;
  return axis.last_sample_age_s === null ? null : axis.last_sample_age_s + Math.max(0, (live.answered ?? arrived) - arrived) / 1000;
}

export function useLive(): Live {
  const [seen, show] = useState(state);
  useEffect(() => {
    const update = (): void => show(state);
    listeners.add(update);
    update();
    return () => void listeners.delete(update);
  }, []);
  return seen;
}

/** Takes over axes that have changed, or all of them; their order stays. */
function take(axes: Axis[], all: boolean): void {
  const now = Date.now();
  for (const axis of axes) {
    state.arrived.set(axis.id, now);
    liveBuffer.add(axis);
  }
  if (all) return set({ axes });
  const changed = new Map(axes.map((axis) => [axis.id, axis]));
  return set({ axes: state.axes.map((axis) => changed.get(axis.id) ?? axis) });
}

let alarmsAt = 0;

/** Requests the state now; called each second, and after a change. */
export async function refresh(): Promise<void> {
  const begin = Date.now();
  try {
    const following = events.isFollowing();
    // The events report changes of the state of an alarm, but not its name or size.
    const alarmsToo = !following || begin - alarmsAt > 1.5 * EVERY_MS;
    const [service, axes, active] = await Promise.all([
      ask<Service>("/api/v1/service"),
      following ? null : ask<Body<"Axes">>("/api/v1/axes"),
      alarmsToo ? ask<Body<"Alarms">>(ACTIVE) : null,
    ]);
    if (service.report !== null) allowReports();
    if (active !== null) alarmsAt = Date.now();
    if (axes !== null) take(axes.axes, true);
    set({
      service, answered: Date.now(), took: Date.now() - begin, failure: "", locked: null,
      ...(active === null ? {} : { active: active.alarms, activeTotal: active.total }),
    });
  } catch (error) {
    if (error instanceof TokenNeeded) set({ locked: failure(error) });
    else set({ failure: isSilence(error) ? "-" : String((error as Error).message) });
  }
}

const events = new Follower({
  axes: take,
  alarm: () => {
    alarmsAt = 0;
    void refresh();
  },
});

async function watch(): Promise<void> {
  await refresh();
  if (state.locked === null && state.failure === "") events.follow();
  setTimeout(() => void watch(), document.hidden ? EVERY_HIDDEN_MS : EVERY_MS);
}

export function start(): void {
  void watch();
  // A request that hangs must not hide that there is no answer.
  setInterval(() => {
    if (silence({ ...state, now: Date.now() }) !== null) set({});
  }, 500);
  document.addEventListener("visibilitychange", () => {
    if (!document.hidden) void refresh();
  });
}
