// Numbers, units and times in readable form, in the language of the page.
import { language } from "./language";

const SUPERSCRIPTS: Record<string, string> = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const raise = (text: string | number): string => [...String(text)].map((c) => SUPERSCRIPTS[c] ?? c).join("");

/** "kg m^2" as "kg m²"; the unit of a ratio is empty. */
export const unit = (text: string): string =>
  text === "1" ? "" : text.replace(/\^(-?\d+)/g, (_, n: string) => raise(n)).replaceAll(" ", "\u202f");

const exponentOf = (x: number): number => (x === 0 ? 0 : Math.floor(Math.log10(Math.abs(x))));

/** A number with the decimal sign of the language, and a real minus sign. */
export const local = (digits: string): string => {
  const text = digits.replace("-", "−");
  return language() === "de" ? text.replace(".", ",") : text;
};

/** A number with so many decimals, after division by 10^power. */
function scaled(x: number, power: number, decimals: number): string {
  const digits = local((x / 10 ** power).toFixed(Math.max(0, decimals)));
  return power ? `${digits}·10${raise(power)}` : digits;
}

const powerOf = (e: number): number => (e < -4 || e > 4 ? e : 0);

/** Four significant digits; powers of ten outside 0.0001 to 99 999. */
export function number(x: number | null): string {
  if (x === null || !Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const e = exponentOf(x);
  const power = powerOf(e);
  return scaled(x, power, 3 - e + power);
}

/** Equidistant numbers, with the decimals that distinguish them, and a common power of ten. */
export function ticks(values: number[]): string[] {
  const step = Math.abs((values[1] ?? 1) - (values[0] ?? 0));
  const e = exponentOf(Math.max(...values.map(Math.abs), 0));
  const power = e < -3 || e > 4 ? e : 0;
  let decimals = Math.max(0, -exponentOf(step) + power);
  // A step of 2.5 needs one more decimal than a step of 2.
  const isWhole = (x: number): boolean => Math.abs(x - Math.round(x)) < 1e-6 * x;
  if (!isWhole((step / 10 ** power) * 10 ** decimals)) decimals += 1;
  return values.map((x) => scaled(x, power, decimals));
}

/** "0.0718 ± 0.0042": the half width to two digits, the value to the same place. */
export function withMargin(x: number | null, half: number | null, sign = false): string {
  if (x === null || !Number.isFinite(x)) return "–";
  const plus = sign && x > 0 ? "+" : "";
  if (half === null || !(half > 0)) return plus + number(x);
  const power = powerOf(exponentOf(x || half));
  const decimals = Math.min(12, 1 - exponentOf(half) + power);
  const plain = (v: number): string => scaled(v / 10 ** power, 0, decimals);
  return power ? `(${plus}${plain(x)} ± ${plain(half)})·10${raise(power)}` : `${plus}${plain(x)} ± ${plain(half)}`;
}

/** A share of the nominal value as "+19.7 %". */
export function percent(share: number | null, sign = true): string {
  if (share === null || !Number.isFinite(share)) return "–";
  const text = (100 * share).toFixed(Math.abs(share) < 1 ? 1 : 0);
  return `${sign && Number(text) > 0 ? "+" : ""}${local(text).replace(/^−(0[.,]?0*)$/, "$1")}\u00a0%`;
}

/** A mean count: "0", "< 0.01", "0.35". */
export const few = (x: number | null): string =>
  x === null || x === 0 || x >= 0.01 ? (x ? local(x.toFixed(2)) : number(x)) : `<\u00a0${local("0.01")}`;

/** The size of a file or of a memory: "293 kB", "6.9 MB", "78 GB". */
export function size(bytes: number): string {
  const [unit, n] = bytes < 1e6 ? ["kB", bytes / 1e3] as const : bytes < 1e9 ? ["MB", bytes / 1e6] as const : ["GB", bytes / 1e9] as const;
  return `${local(n.toFixed(n < 10 && unit !== "kB" ? 1 : 0))}\u00a0${unit}`;
}

export const count = (n: number): string => String(n).replace(/\B(?=(\d{3})+$)/g, "\u202f");

/** A span of seconds: "0.4 s", "12 s", "3 min", "5 h", "2 d". */
export function span(s: number): string {
  if (s < 10) return local(`${s.toFixed(1)} s`);
  if (s < 120) return `${Math.round(s)} s`;
  if (s < 7200) return `${Math.round(s / 60)} min`;
  return s < 172800 ? `${Math.round(s / 3600)} h` : `${Math.round(s / 86400)} d`;
}

/** With a leading zero. */
export const two = (n: number): string => String(n).padStart(2, "0");

/** The date in the format of the language. */
export function date(d: Date): string {
  const [y, m, day] = [d.getFullYear(), two(d.getMonth() + 1), two(d.getDate())];
  return language() === "de" ? `${day}.${m}.${y}` : `${y}-${m}-${day}`;
}

/** Local time of an ISO 8601 text or a Date, with the date. */
export function stamp(when: string | number | Date): string {
  const d = new Date(when);
  return `${date(d)} ${two(d.getHours())}:${two(d.getMinutes())}:${two(d.getSeconds())}`;
}

/** The same; with the date only if it is not today. */
export function moment(when: string | number | Date): string {
  const text = stamp(when);
  return new Date(when).toDateString() === new Date().toDateString() ? text.slice(-8) : text;
}

/** "Europe/Berlin, UTC+01:00": the time zone of this browser, at a time. */
export function zone(at: Date = new Date()): string {
  const minutes = -at.getTimezoneOffset();
  const size = Math.abs(minutes);
  const offset = minutes ? `UTC${minutes < 0 ? "−" : "+"}${two(Math.floor(size / 60))}:${two(size % 60)}` : "UTC";
  const name = Intl.DateTimeFormat().resolvedOptions().timeZone;
  return name && name !== "UTC" ? `${name}, ${offset}` : offset;
}
