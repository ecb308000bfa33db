// Numbers, units and times as people read them.

const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };
const raise = (text) => [...String(text)].map((c) => SUPERSCRIPTS[c] ?? c).join("");

/** "kg m^2" as "kg m²", and nothing for the unit of a ratio. */
export const unit = (text) => (text === "1" ? "" : text.replace(/\^(-?\d+)/g, (_, n) => raise(n)).replaceAll(" ", "\u202f"));

const exponentOf = (x) => (x === 0 ? 0 : Math.floor(Math.log10(Math.abs(x))));

/** With so many decimals, after taking out 10^power. */
function scaled(x, power, decimals) {
  const digits = (x / 10 ** power).toFixed(Math.max(0, decimals)).replace("-", "−");
  return power ? `${digits}·10${raise(power)}` : digits;
}

/** Four significant digits; powers of ten outside 0.0001 to 99 999. */
export function number(x) {
  if (x === null || Number.isNaN(x)) return "–";
  const e = exponentOf(x);
  const power = e < -4 || e > 4 ? e : 0;
  return scaled(x, power, 3 - e + power);
}

/** "0.0718 ± 0.0021": the deviation to two digits, the value to the same place. */
export function withDeviation(x, sd, sign = false) {
  if (x === null || Number.isNaN(x)) return "–";
  const plus = sign && x > 0 ? "+" : "";
  if (sd === null || sd <= 0) return plus + number(x);
  const e = exponentOf(x || sd);
  const power = e < -4 || e > 4 ? e : 0;
  const decimals = Math.min(12, 1 - exponentOf(sd) + power);
  const tail = power ? `·10${raise(power)}` : "";
  const plain = (v) => scaled(v / 10 ** power, 0, decimals);
  return tail ? `(${plus}${plain(x)} ± ${plain(sd)})${tail}` : `${plus}${plain(x)} ± ${plain(sd)}`;
}

/** A share of the nominal value as "+19.7 %". */
export function percent(share) {
  if (share === null || !Number.isFinite(share)) return "–";
  const digits = Math.abs(share) < 1 ? 1 : 0;
  const text = (100 * share).toFixed(digits);
  return `${Number(text) > 0 ? "+" : ""}${text.replace("-", "−").replace(/^−(0\.?0*)$/, "$1")} %`;
}

export const count = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, "\u202f");

/** A span of seconds: "0.4 s", "12 s", "3 min", "5 h", "2 d". */
export function span(s) {
  if (s < 10) return `${s.toFixed(1)} s`;
  if (s < 120) return `${Math.round(s)} s`;
  if (s < 7200) return `${Math.round(s / 60)} min`;
  return s < 172800 ? `${Math.round(s / 3600)} h` : `${Math.round(s / 86400)} d`;
}

const two = (n) => String(n).padStart(2, "0");

/** Local time of an ISO 8601 text or a Date; the date only where it is not today. */
export function moment(when) {
  const d = new Date(when);
  const clock = `${two(d.getHours())}:${two(d.getMinutes())}:${two(d.getSeconds())}`;
  const today = d.toDateString() === new Date().toDateString();
  return today ? clock : `${d.getFullYear()}-${two(d.getMonth() + 1)}-${two(d.getDate())} ${clock}`;
}

/** "UTC+01:00" of this browser. */
export function zone() {
  const minutes = -new Date().getTimezoneOffset();
  const size = Math.abs(minutes);
  return minutes ? `UTC${minutes < 0 ? "−" : "+"}${two(Math.floor(size / 60))}:${two(size % 60)}` : "UTC";
}
