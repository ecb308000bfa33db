// The data layer of the dashboard: what is plotted, the order of the axes, how numbers and times are written.
import { beforeEach, describe, expect, test } from "vitest";
import { alarmSentence, meaningOf, stepText } from "../src/alarm_words";
import { Refused, type Alarm, type Axis, type Body } from "../src/ask";
import { chainOf, monitoredIn, placeless, type Component, type DriveModel } from "../src/chain";
import { EventParser } from "../src/events";
import * as format from "../src/format";
import { liveBuffer } from "../src/live_buffer";
import { hiddenText, shareText } from "../src/marks";
import { itemsOf, matches, ordered } from "../src/need";
import { farthest, signsOf } from "../src/resonances";
import { causeName, failure, translated } from "../src/sentences";
import { columnsOf, marksOf, rangeOf, type History } from "../src/series";
import { emptySignals, joined, type Signals } from "../src/signal_buffer";
import { choose, t } from "../src/texts";
import { GAP, layoutOf } from "../src/tile_layout";
import { moved, scaled } from "../src/time_range";
import { trendColumns } from "../src/trend_columns";

const T0 = Date.parse("2026-03-01T12:00:00Z") / 1000;
const iso = (s: number): string => new Date((T0 + s) * 1000).toISOString();

function parameter(changes: object = {}) {
  return {
    name: "fm", meaning: "friction", unit: "1", nominal: 1, estimate: 1.1, standard_deviation: 0.1, threshold: 4,
    cusum: { up: 2, down: 0 }, status: "tracking", observation: "observed", tested: true, ...changes,
  };
}

function axisOf(id: string, changes: object = {}): Axis {
  return { id, bus: "can0", last_sample: iso(0), last_sample_age_s: 0.1, silent: false, parameters: [parameter()], sentences: [], ...changes } as unknown as Axis;
}

function alarmOf(axis: string, changes: object = {}): Alarm {
  return {
    id: 1, axis, parameter: "fm", direction: "up", priority: "medium", state: "unacknowledged", active: true,
    onset: iso(0), ended: null, ...changes,
  } as unknown as Alarm;
}

beforeEach(() => {
  globalThis.document = { documentElement: {} } as unknown as Document;
  choose("en");
});

type Numbers = (number | null)[];

function historyOf(n: number[], estimate: Numbers, others: Record<string, Numbers> = {}): History {
  const column = (mean: Numbers) => ({ unit: "1", mean, min: mean, max: mean });
  const of = (name: string, value: number) => column(others[name] ?? n.map((k) => (k === 0 ? null : value)));
  const parameters = [{
    name: "fm", unit: "1", nominal: 1, n, estimate: column(estimate), deviation: of("deviation", 0.5),
    standard_deviation: of("standard_deviation", 0.1), cusum_up: of("cusum_up", 2), cusum_down: of("cusum_down", 0),
    threshold: of("threshold", 4), observability: of("observability", 1),
  }];
  return { axis: "a", resolution: "raw", step_s: 10, next: null, time: n.map((_, i) => iso(10 * i)), parameters };
}

describe("an alarm in a sentence", () => {
  const fm = alarmOf("a", {
    stage: "named", size: 0.018, size_sd: 0.001, nominal: 0.06, unit: "N m s/rad", kind: "step", doubt: "", reaches: [], inside_calibration: true, same_payload: [],
    causes: [{ parameter: "fm", probability: 0.99, alike: [] }], words: "as the daemon says it",
  });
  const changed = (changes: object): Alarm => ({ ...fm, ...changes }) as unknown as Alarm;

  test("is that of the daemon in English", () => {
    expect(alarmSentence(fm)).toBe("as the daemon says it");
    expect(meaningOf("viscous friction of the motor")).toBe("viscous friction of the motor");
  });

  test("is German in German", () => {
    choose("de");
    const unit = "N\u202fm\u202fs/rad";
    expect(alarmSentence(fm)).toBe(`fm liegt 0,018 ${unit} (30 %, 27 bis 33) über dem Nennwert`);
    expect(alarmSentence(changed({ stage: "changed", ended: null }))).toMatch(/auf den ersten Blick fm;.* sind noch nicht bekannt$/);
    expect(alarmSentence(changed({ stage: "changed", ended: "2026-03-01T00:00:00Z" }))).toMatch(/Größe wurden nicht bekannt$/);
    expect(alarmSentence(changed({ size: null, direction: "down" }))).toContain("fm liegt unter dem Nennwert, um wie viel");
    expect(alarmSentence(changed({ causes: [{ parameter: "kT", probability: 0.6, alike: [] }, { parameter: "fm", probability: 0.4, alike: ["fc", "torque scale"] }] })))
      .toBe(`kT oder fm, 60:40; fm liegt 0,018 ${unit} (30 %, 27 bis 33) über dem Nennwert; gleich sähe aus: fc oder Maßstab des Moments`);
    expect(alarmSentence(changed({ same_payload: ["arm.2", "arm.3"] })))
      .toMatch(/Nennwert; arm\.2, arm\.3 zur selben Zeit ebenso: eine andere Nutzlast ist wahrscheinlicher/);
    expect(alarmSentence(changed({ parameter: "delay", size: 0.0005, nominal: 0 }))).toContain("kommt 0,5 ms zu spät");
    expect(alarmSentence(changed({ parameter: "delay", size: null, nominal: 0 }))).toContain("kommt zu spät, um wie viel");
    expect(alarmSentence(changed({ doubt: "still", inside_calibration: false }))).toMatch(/keine Bewegung.*; außerhalb/);
    const reach = {
      name: "fm", limit: 0.09, unit: "N m s/rad", above: true, state: "ahead", low: "2026-03-13T00:00:00Z", high: "2026-03-21T00:00:00Z", words: "",
    };
    expect(alarmSentence(changed({ reaches: [reach], updated: "2026-03-01T00:00:00Z" })))
      .toBe(`fm erreicht 0,09 ${unit} in 12 bis 20 Tagen; jetzt: fm liegt 0,018 ${unit} (30 %, 27 bis 33) über dem Nennwert`);
    expect(meaningOf("reciprocal of: inertia of the arm")).toBe("Kehrwert von: Trägheit des Arms");
    expect(meaningOf("damping of the gearbox, arm side")).toBe("Dämpfung des Getriebes, Armseite");
    expect(meaningOf("inertia of the mass 4, arm side")).toBe("Trägheit der Masse 4, Armseite");
    expect(meaningOf("stiffness of the spring 1, arm side")).toBe("Steifigkeit der Feder 1, Armseite");
    expect(meaningOf("friction of my drive")).toBe("friction of my drive");
    expect(meaningOf("inertia of the wheel, arm side")).toBe("inertia of the wheel, arm side");
  });
});

describe("the course of a parameter in German", () => {
  const history = (drift: object | null): Body<"LongTermHistory"> =>
    ({ name: "fm", unit: "1", words: "", limits: [], drift }) as unknown as Body<"LongTermHistory">;
  const drift = {
    time: "1970-01-02T00:00:00Z", changed: "1970-01-01T12:00:00Z", steady: 0, drift: 0, step: 0, both: 0, level: 0.0612345, level_sd: 0.000123,
    slope_per_day: -0.00123, slope_per_day_sd: 0.0001, change: 0.0123, change_sd: 0.001,
  };
  const course = (changes: object): string | null => t.course(history({ ...drift, ...changes }), "");
  beforeEach(() => choose("de"));

  test("is a sentence for each kind of course", () => {
    expect(t.course(history(null), "")).toContain("zu wenig Daten");
    expect(course({ drift: 0.95 })).toBe("fm driftet um 0,0012 ± 0,0001 pro Tag nach unten");
    expect(course({ both: 0.95 })).toBe("fm driftet um 0,0012 ± 0,0001 pro Tag nach unten, seit einer Änderung etwa 12 Stunden vor dem Ende");
    expect(course({ steady: 0.95 })).toBe("fm ist stetig: 0,06123 ± 0,00012");
    expect(course({ step: 0.95 })).toBe("fm ist etwa 12 Stunden vor dem Ende auf einmal um 0,012 ± 0,001 gestiegen");
    expect(course({ steady: 0.6, drift: 0.38, step: 0.02 })).toBe("fm: stetig oder Drift, 60:38; im Mittel um 0,0012 ± 0,0001 pro Tag nach unten");
  });

  test("says when a limit is reached", () => {
    const reach = { name: "fm", limit: 0.09, unit: "1", above: true, state: "far", low: "1970-01-31T00:00:00Z", high: null, words: "" } as const;
    const from = "1970-01-01T00:00:00Z";
    expect(t.reach(reach, "", from)).toBe("fm = 0,09 ist nicht in Sicht: nicht innerhalb von 30 Tagen");
    expect(t.reach({ ...reach, state: "open" }, "", from)).toBe("fm erreicht 0,09 in 30 Tagen oder später, vielleicht nie");
    const beyond = { ...reach, state: "beyond", low: "1970-01-01T00:00:00Z", high: "1970-01-01T12:00:00Z" } as const;
    expect(t.reach(beyond, "", "1970-01-02T00:00:00Z")).toBe("fm liegt seit 12 bis 24 Stunden über 0,09");
  });
});

describe("what is not tested", () => {
  const axis = axisOf("a", {
    gated_by: "payload", not_tested: ["as the daemon says it"],
    parameters: ["not observed", null, "not observed", "operating conditions"].map((reason, k) => parameter({ name: `p${k}`, not_tested_reason: reason })),
  });
  test("is that of the daemon in English", () => expect(t.notTestedSentences(axis, "payload")).toEqual(["as the daemon says it"]));

  test("is a sentence for each reason in German", () => {
    choose("de");
    const [unseen, gated, ...more] = t.notTestedSentences(axis, "payload");
    expect(unseen).toMatch(/^p0, p2 werden nicht geprüft: die Bewegung enthält fast keine Information darüber. Nötig: Bewegung/);
    expect(gated).toMatch(/^p3 wird nicht geprüft: die Betriebsbedingungen schließen die Messwerte aus \(payload\). Nötig/);
    expect(more).toEqual([]);
  });
});

describe("columns of a plot", () => {
  test("have the 90 % band, the nominal value of that time, the statistics relative to the threshold", () => {
    const c = columnsOf("fm", historyOf([1], [1.5]), []);
    expect(c).toMatchObject({ time: [T0], estimate: [1.5], nominal: [1], up: [0.5], down: [0] });
    expect(c.low[0]).toBeCloseTo(1.5 - 0.1645, 4);
    expect(c.high[0]).toBeCloseTo(1.5 + 0.1645, 4);
  });

  test("are broken at a gap, whatever a row without points holds", () => {
    const c = columnsOf("fm", historyOf([1, 0, 1], [1, 7, 2]), []);
    expect(c.estimate).toEqual([1, null, 2]);
    expect(c.up).toEqual([0.5, null, 0.5]);
  });

  test("have no value where there is no number", () => {
    const c = columnsOf("fm", historyOf([1, 1, 1], [NaN, Infinity, null], { threshold: [0, -1, null] }), []);
    expect(c.estimate).toEqual([null, null, null]);
    expect(c.low).toEqual([null, null, null]);
    expect(c.up).toEqual([null, null, null]);
  });

  test("go on with what the page has seen, after a gap where nothing was seen, and never twice", () => {
    for (const s of [0, 5, 100]) liveBuffer.add(axisOf("live", { last_sample: iso(s), parameters: [parameter({ name: "kT" }), parameter()] }));
    const live = liveBuffer.after("live", 0);
    const c = columnsOf("fm", historyOf([1], [1]), live);
    expect(c.time.map((s) => s - T0)).toEqual([0, 5, 52.5, 100]);
    expect(c.estimate).toEqual([1, 1.1, null, 1.1]);
  });

  test("are empty without a history, or with another parameter", () => {
    expect(columnsOf("fm", null, []).time).toEqual([]);
    expect(columnsOf("kT", historyOf([1], [1]), []).time).toEqual([]);
  });
});

test("the page keeps the last two minutes of an axis, a point each half second, in order", () => {
  for (const s of [0, 0.2, 1, 1, 50, 130]) liveBuffer.add(axisOf("kept", { last_sample: iso(s) }));
  const times = (after: number): number[] => liveBuffer.after("kept", T0 + after).map(({ time }) => time - T0);
  expect(times(0)).toEqual([50, 130]);
  expect(times(50)).toEqual([130]);
  liveBuffer.add(axisOf("kept", { last_sample: iso(60) })); // the clock was set back
  expect(times(0)).toEqual([60]);
});

describe("the range of a plot", () => {
  test("holds all values with a margin", () => expect(rangeOf([[1, 2], [null, 0]])).toEqual([-0.12, 2.12]));
  test("has a constant value in its middle", () => {
    const [low, high] = rangeOf([[5, 5, 5]]);
    expect((low + high) / 2).toBeCloseTo(5);
    expect(high).toBeGreaterThan(low);
  });
  test("is never empty", () => {
    for (const values of [[], [null], [NaN], [Infinity, -Infinity], [0], [1e300], [1e-300]]) {
      const [low, high] = rangeOf([values]);
      expect(Number.isFinite(low) && Number.isFinite(high) && high > low, String(values)).toBe(true);
    }
  });
  test("holds what must be seen", () => expect(rangeOf([[1]], [0, 2])).toEqual([-0.12, 2.12]));
});

describe("marks of alarms", () => {
  const alarms = [
    alarmOf("a", { ended: iso(10) }), alarmOf("a", { onset: iso(50) }), alarmOf("a", { parameter: "kT" }),
    alarmOf("a", { parameter: "torque sign", onset: iso(60) }),
  ];
  test("reach from onset to end; a sensor fault concerns all parameters", () => {
    const marks = marksOf(alarms, "fm", ["fm", "kT"], T0 - 10, T0 + 100);
    expect(marks.map(({ from, to }) => [from - T0, to && to - T0])).toEqual([[0, 10], [50, null], [60, null]]);
  });
  test("are those of the range", () => expect(marksOf(alarms, "fm", ["fm", "kT"], T0 + 20, T0 + 30)).toEqual([]));
});

describe("need", () => {
  const axes = [
    axisOf("r.10"), axisOf("r.9"), axisOf("silent", { last_sample_age_s: 60, silent: true }),
    axisOf("untested", { parameters: [parameter({ tested: false })] }), axisOf("known"), axisOf("low"), axisOf("high"),
    axisOf("near", { parameters: [parameter({ cusum: { up: 0, down: 3.9 } })] }), axisOf("hidden"),
  ];
  const alarms = [
    alarmOf("low", { priority: "low" }), alarmOf("high", { priority: "high" }), alarmOf("hidden", { state: "shelved" }),
    alarmOf("known", { state: "acknowledged", priority: "high" }),
  ];
  const names = (order: "need" | "name"): string[] => ordered(itemsOf(axes, alarms), order).map(({ axis }) => axis.id);

  test("sorts the most urgent first, the others by evidence and name", () => {
    expect(names("need")).toEqual(["high", "low", "known", "silent", "untested", "near", "hidden", "r.9", "r.10"]);
  });
  test("tells of an alarm that is shelved", () => {
    const texts = itemsOf(axes, alarms).map((item) => [item.axis.id, hiddenText(item)]);
    expect(texts.filter(([, text]) => text !== "")).toEqual([["hidden", "shelved: ▲ fm"]]);
  });
  test("sorts by name with numbers as numbers", () => {
    expect(names("name").slice(-4)).toEqual(["r.9", "r.10", "silent", "untested"]);
  });
  test("is searched by all words", () => {
    const item = itemsOf([axisOf("cell.Axis3")], [])[0]!;
    expect(["", "axis3", "FRICTION cell", "can0"].map((words) => matches(item, words))).toEqual([true, true, true, true]);
    expect(matches(item, "axis3 torque")).toBe(false);
  });
});

describe("a step of an alarm", () => {
  const until = iso(3600);
  type Step = Body<"AlarmTransition">;
  const words = (event: Step["event"], from_state: Step["from_state"], to_state: Step["to_state"], end: string | null): string =>
    stepText({ at: iso(0), event, from_state, to_state, until: end, who: "anna", comment: null, work_order: null });
  test("says until when it is shelved, once", () => {
    const shown = t.until(format.moment(until));
    expect(words("shelve", "acknowledged", "shelved", until)).toBe(`shelved ${shown}`);
    expect(words("raise", "normal", "shelved", until)).toBe(`raised, shelved ${shown}`);
    expect(words("comment", "shelved", "shelved", until)).toBe("comment");
    expect(words("acknowledge", "unacknowledged", "acknowledged", null)).toBe("acknowledged");
  });
});

describe("tiles", () => {
  test("of 300 axes fit on a wall screen", () => {
    const { columns, bar, wide } = layoutOf(300, 3, 1888, 850);
    expect(wide).toBe(false);
    expect(Math.ceil(300 / columns) * (27 + 3 * (3 + bar) + GAP)).toBeLessThanOrEqual(850 + GAP);
  });
  test("of a few are larger on a wall, where all still fit", () => {
    const { columns, wide, zoom } = layoutOf(6, 3, 2400, 1200);
    expect([wide, zoom]).toEqual([true, 2]);
    expect(zoom * Math.ceil(6 / columns) * (74 + 36 * 3)).toBeLessThan(1200);
    expect(layoutOf(60, 3, 2400, 1200).zoom).toBe(1);
    expect(layoutOf(6, 3, 1248, 600).zoom).toBe(1);
  });
  test("of a few show numbers, on a phone, too", () => {
    expect(layoutOf(6, 3, 1888, 850).wide).toBe(true);
    expect(layoutOf(6, 3, 340, 400)).toMatchObject({ columns: 1, wide: true });
  });
  test("that do not fit have names that can be read", () => expect(layoutOf(2000, 3, 1888, 850).columns).toBe(14));
});

describe("a deviation in little room", () => {
  const of = (nominal: number | null, estimate: number | null): string => shareText(parameter({ nominal, estimate, unit: "N m" }) as unknown as Axis["parameters"][number]);
  test("is a share, or a short number where nominal is zero", () => {
    expect([of(2, 1), of(0, 0.012345), of(0, -3.14159e-9), of(0, 0), of(0, null), of(null, 1)])
      .toEqual(["−50.0\u00a0%", "+0.012", "−3.1e-9", "0", "–", "–"]);
  });
});

describe("the range of time", () => {
  test("moves, and follows the newest time when it reaches it", () => {
    expect(moved({ length: 100, end: null }, -0.25, 1000)).toEqual({ length: 100, end: 975 });
    expect(moved({ length: 100, end: 975 }, 0.25, 1000)).toEqual({ length: 100, end: null });
  });
  test("grows about its middle, or from its end while it follows", () => {
    expect(scaled({ length: 100, end: 500 }, 2, 1000)).toEqual({ length: 200, end: 550 });
    expect(scaled({ length: 100, end: null }, 0.5, 1000)).toEqual({ length: 50, end: null });
  });
});

describe("a trend", () => {
  const limit = { name: "fm", limit: 2, state: "ahead", low: iso(10 * 86400), high: iso(15 * 86400) };
  const drift = { time: iso(10 * 86400), since: iso(0), level: 1.5, level_sd: 0.03, slope_per_day: 0.1, slope_per_day_sd: 0.01 };
  const p = { name: "fm", nominal: 1, drift, limits: [limit], time: [iso(0), iso(10 * 86400)], mean: [0.5, 1.5] };
  const c = trendColumns(p as unknown as Body<"LongTermHistory">);
  test("goes on to the limit, its band grows from the last entry on", () => {
    expect((c.time.at(-1)! - T0) / 86400).toBeCloseTo(15);
    expect(c.trend.at(-1)).toBeCloseTo(2);
    expect(c.high.at(-1)).toBeCloseTo(2 + 2 * Math.hypot(0.03, 0.05));
    expect(c.low.slice(0, 2)).toEqual([null, 1.44]);
    expect(c.mean.slice(0, 3)).toEqual([0.5, 1.5, null]);
  });
  test("has a bar where the limit is reached", () => expect(c.limits[0]!.slice(0, 3)).toEqual([null, 2, 2]));
});

describe("sentences of the daemon", () => {
  const words = (kind: string, values: Body<"Sentence">["values"] = {}, text = kind): Body<"Sentence"> => ({ words: text, kind, values });
  const names = words("joined", { 0: "kT", 1: "fm", 2: "fc", separator: ", and " }, "kT, fm and fc");
  const lost = words("not used", { axis: "a.b", why: words("lost", { why: words("damaged"), parts: words("part of", { part: words("part history"), names }) }) }, "in English");
  const german = (...found: Body<"Sentence">[]) => translated(found[0]?.words ?? "", found);

  beforeEach(() => choose("de"));
  test("are German by their kind and values, also within each other", () => {
    expect(german(lost)).toBe(
      "a.b: der gesicherte Zustand wird nicht verwendet und wurde beiseitegelegt: er ist beschädigt (falsche Prüfsumme)"
      + " (neu begonnen: die Langzeitgeschichte von kT, fm und fc)",
    );
    expect(german(words("alike", { first: "fm", last: "fc" }))).toBe("fm und fc sind nicht zu unterscheiden");
    expect(german(words("down", { why: "Network is down" }))).toBe("gestört: Network is down");
    expect(german(words("not calibrated", { name: "T", value: "41.5", low: "20", high: "3.5e-07" }))).toBe("T = 41,5, kalibriert von 20 bis 3,5e−07");
    expect(german(words("joined", { 0: words("closed"), 1: "b", separator: "; " }))).toBe("geschlossen; b");
    const clock = german(words("clock set back", { way: "back", by: "2 hours", by_s: "7200.0", at: "2026-03-01T12:00:00Z" }));
    expect(clock).toMatch(/^Die Uhr dieses Rechners wurde um 2 h zurückgestellt; 01\.03\.2026 .* ist die erste Zeit danach/);
    expect(german(words("not possible", { event: "acknowledge", state: "acknowledged", advice: "wait" }))).toBe("Nicht möglich („quittiert“): der Alarm ist jetzt „quittiert“");
  });
  test("are English where the page is, or where there is no German", () => {
    expect(german(words("of tomorrow"))).toBeNull();
    expect(translated("another text", [lost])).toBeNull();
    expect(failure(new Refused("full", []))).toBe("full");
    expect(failure(new Refused("none", [words("no frames kept", {}, "none")]))).toMatch(/^recordings_mb in \[service\] ist 0/);
    choose("en");
    expect(german(lost)).toBeNull();
  });
  test("causes that are no parameter have a name", () => {
    expect([causeName("torque sign"), causeName("kT")]).toEqual(["Vorzeichen des Moments", "kT"]);
    choose("en");
    expect(causeName("torque sign")).toBe("torque sign");
  });
});

test("events come in pieces; comments are none", () => {
  const parser = new EventParser();
  expect(parser.add("event: axes\ndata: {\"a\"")).toEqual([]);
  expect(parser.add(":1}\n\n: keep-alive\n\nid: 7\nevent: alarm\r\ndata: x\ndata: y\n")).toEqual([{ event: "axes", data: '{"a":1}' }]);
  expect(parser.add("\n")).toEqual([{ event: "alarm", data: "x\ny" }]);
});

describe("numbers and times", () => {
  test.each([
    [format.number(0.06), "0.06000"],
    [format.number(95.717), "95.72"],
    [format.number(0), "0"],
    [format.number(-123456), "−1.235·10⁵"],
    [format.number(0.0000123), "1.230·10⁻⁵"],
    [format.number(null), "–"],
    [format.withMargin(0.07832, 0.00256), "0.0783 ± 0.0026"],
    [format.withMargin(-0.203, 0.018, true), "−0.203 ± 0.018"],
    [format.withMargin(12345, 2000), "12345 ± 2000"],
    [format.withMargin(5.9e-6, 3e-7, true), "(+5.90 ± 0.30)·10⁻⁶"],
    [format.withMargin(0, 0.002), "0.0000 ± 0.0020"],
    [format.withMargin(0.5, null, true), "+0.5000"],
    [format.withMargin(NaN, 1), "–"],
    [format.percent(0.305), "+30.5\u00a0%"],
    [format.percent(-0.00001), "0.0\u00a0%"],
    [format.percent(-0.2), "−20.0\u00a0%"],
    [format.percent(1.57), "+157\u00a0%"],
    [format.count(1234567), "1\u202f234\u202f567"],
    [format.unit("kg m^2"), "kg\u202fm²"],
    [format.unit("1"), ""],
    [format.span(0.44), "0.4 s"],
    [format.span(75), "75 s"],
    [format.span(3600 * 5), "5 h"],
    [format.few(0.0009921), "<\u00a00.01"],
    [format.few(0.349), "0.35"],
    [format.few(0), "0"],
    [format.size(292_500), "293\u00a0kB"],
    [format.size(6_937_000), "6.9\u00a0MB"],
    [format.size(78.016e9), "78\u00a0GB"],
    [format.ticks([145.25, 145.5, 145.75]).join(" "), "145.25 145.50 145.75"],
    [format.ticks([0.95, 1, 1.05]).join(" "), "0.95 1.00 1.05"],
    [format.ticks([0, 2e-5, 4e-5]).join(" "), "0·10⁻⁵ 2·10⁻⁵ 4·10⁻⁵"],
  ])("%s", (written, expected) => expect(written).toBe(expected));
  test("have a comma in German, and its dates", () => {
    choose("de");
    expect(format.withMargin(0.07832, 0.00256)).toBe("0,0783 ± 0,0026");
    expect(format.percent(-0.00001)).toBe("0,0\u00a0%");
    expect(format.date(new Date(2026, 2, 1))).toBe("01.03.2026");
  });
});

function component(kind: string, nodes: string[], ...names: string[]): Component {
  return { name: `${kind} ${names.join(" ")}`.trim(), kind, nodes, parameters: names.map((name) => ({ role: name, text: name, names: [name] })) };
}

const nameOf = (c: Component): string => c.name;

describe("the chain of a drive", () => {
  const THREE = [
    component("inertia", ["arm", "end"], "Ja"), component("spring-damper", ["gearbox", "arm"], "ka", "da"), component("gain", [], "kT"),
    component("torque", ["motor"]), component("inertia", ["motor", "gear.a"], "Jm"), component("ideal-gear", ["gear.a", "gear.b"], "r"),
    component("damper", ["motor", "ground"], "fm"), component("fixed", ["ground"]), component("spring", ["gear.b", "gearbox"], "kg"),
    component("damper", ["gearbox", "gear.b"], "dg"), component("inertia", ["gearbox"], "Jg"), component("gravity", ["end"], "gc"),
  ];

  test("goes from the motor outwards; what turns together is one shaft, what is held by the ground acts on it", () => {
    const rows = chainOf(THREE);
    expect(rows.map((row) => row.stages.map(({ links, shaft }) => [links.map(nameOf), shaft.masses.map(nameOf), shaft.attached.map(nameOf)]))).toEqual([[
      [[], ["inertia Jm"], ["gain kT", "torque", "damper fm"]],
      [["ideal-gear r"], [], []],
      [["spring kg", "damper dg"], ["inertia Jg"], []],
      [["spring-damper ka da"], ["inertia Ja"], ["gravity gc"]],
    ]]);
  });

  test("has friction where a damper is held by the ground", () => {
    expect(chainOf(THREE)[0]?.stages[0]?.shaft.attached.map((c) => c.kind)).toEqual(["gain", "torque", "viscous-friction"]);
  });

  test("has a row for each branch, and loses nothing in a loop or behind no motor", () => {
    const branched = [
      component("torque", ["m"]), component("inertia", ["m"], "J"), component("spring", ["m", "a"], "k1"), component("spring", ["m", "b"], "k2"),
      component("spring", ["b", "c"], "k3"), component("inertia", ["c"], "Jc"), component("spring", ["x", "y"], "k4"),
    ];
    const rows = chainOf(branched);
    expect(rows.map((row) => row.stages.map((stage) => stage.links.map(nameOf)))).toEqual([
      [[], ["spring k2"], ["spring k3"]], [["spring k1"]], [[], ["spring k4"]],
    ]);
    expect(rows[1]?.from).toBe(rows[0]?.stages[0]?.shaft);
    const loop = [component("torque", ["a"]), ...["ab", "bc", "ca"].map((ends) => component("spring", [...ends], ends))];
    expect(chainOf(loop)[0]?.stages).toHaveLength(3);
    expect(chainOf([])).toEqual([]);
  });

  test("says which monitored parameters are in a component, also of merged ones, and which are nowhere", () => {
    const monitored = [{ name: "1/Ja", names: ["Ja"] }, { name: "J", names: ["Jm", "Jg", "r"] }, { name: "delay", names: ["delay"] }];
    const model: DriveModel = { axis: "a", drive: "d", components: THREE, monitored };
    const of = (name: string) => monitoredIn(THREE.find((c) => c.name === name) as Component, model);
    expect([of("inertia Ja"), of("inertia Jm"), of("ideal-gear r"), of("gravity gc")]).toEqual([["1/Ja"], ["J"], ["J"], []]);
    expect(placeless(model)).toEqual(["delay"]);
  });
});

describe("the signals of the last seconds", () => {
  function answer(begin: number, count: number, changes: object = {}): Signals {
    const k = Array.from({ length: count }, (_, i) => i);
    return {
      axis: "a", begin: iso(begin), end: iso(begin + 0.1 * (count - 1)), unit: "rad", outlier_limit: null, time_s: k.map((i) => 0.1 * i),
      torque: k, measured: k, predicted: k, error: k.map(() => 0.5), learned: k.map(() => true), ...changes,
    };
  }

  test("are joined, and only ten of them are kept", () => {
    let c = joined(emptySignals(), answer(0, 10));
    c = joined(c, answer(1, 100));
    expect(c.time.at(-1)).toBeCloseTo(T0 + 10.9);
    expect(c.time[0]).toBeCloseTo(T0 + 0.9);
    expect(c.torque).toHaveLength(c.time.length);
    expect([c.torque[0], c.torque[1]]).toEqual([9, 0]);
    expect(joined(c, answer(0, 0, { begin: null, end: null }))).toBe(c);
  });

  test("have a gap where samples lack, and begin anew when the clock was set back", () => {
    const c = joined(joined(emptySignals(), answer(0, 2)), answer(3, 2));
    expect(c.measured).toEqual([0, 1, null, 0, 1]);
    expect(joined(c, answer(-60, 2)).time[0]).toBeCloseTo(T0 - 60);
  });

  test("mark the errors that nothing was learned from", () => {
    const c = joined(emptySignals(), answer(0, 3, { learned: [true, false, false], error: [1, 7, null] }));
    expect([c.error, c.passed]).toEqual([[1, 7, null], [null, 7, null]]);
  });
});

describe("what has changed in a Bode plot", () => {
  test("are resonances that have moved by more than 1 %, and the largest change of the magnitude", () => {
    const resonances = [{ nominal_hz: 10, present_hz: 10.05 }, { nominal_hz: 20, present_hz: 22 }, { nominal_hz: 30, present_hz: null }];
    expect(signsOf(resonances)).toEqual([{ at: 10, mark: "○" }, { at: 20, mark: "○" }, { at: 22, mark: "▲" }, { at: 30, mark: "○" }]);
    const curve = (magnitude_db: Numbers) => ({ magnitude_db, phase_deg: magnitude_db });
    const bode = { axis: "a", unit: "rad per N m", frequency_hz: [1, 2, 3, 4], nominal: curve([0, 0, 0, null]),
      without_estimate: [], magnitude_sd_db: [], phase_sd_deg: [], resonances };
    expect(farthest({ ...bode, present: curve([1, -3, 2, 9]) })).toEqual({ hz: 2, db: -3 });
    expect(farthest({ ...bode, present: curve([0.05, 0, 0, null]) })).toBeNull();
    expect(farthest({ ...bode, present: null })).toBeNull();
  });
});
