// Texts of the daemon in the language of the page: by their kind and values, never by their English words.
import { isSilence, Refused, type Body } from "./ask";
import { local, moment, span } from "./format";
import { t } from "./texts";

type Sentence = Body<"Sentence">;

/** The text in the language of the page, if one of these sentences is it; null: it is shown in English. */
export function translated(text: string, sentences: Sentence[]): string | null {
  const found = sentences.find((sentence) => sentence.words === text);
  return found === undefined ? null : inOwnWords(found);
}

function inOwnWords({ kind, values }: Sentence): string | null {
  if (kind === "joined") {
    const { separator, ...parts } = values;
    const texts = Object.entries(parts).map(([name, value]) => shown(name, value));
    return separator === "; " ? texts.join("; ") : t.list(texts);
  }
  return t.sentences[kind]?.replace(/\{(\w+)\}/g, (_, name: string) => shown(name, values[name] ?? "?")) ?? null;
}

/** A cause of alarms: a parameter by its name, a sensor fault in the language of the page. */
export const causeName = (cause: string): string => t.cause[cause] ?? cause;

/** Author of an action: a person by name, or a part of the daemon. */
export const whoName = (who: string): string => t.who[who] ?? who;

export const listed = (...texts: (string | null)[]): string => texts.filter(Boolean).join("; ");

/** Comment and work order of an action. */
export const noteText = ({ comment, work_order }: { comment: string | null; work_order: string | null }): string =>
  listed(comment, work_order && t.workOrder(work_order));

/** A value; its name tells its kind: _s a time in seconds, `at` a point in time. */
function shown(name: string, value: string | Sentence): string {
  if (typeof value !== "string") return inOwnWords(value) ?? value.words;
  if (name.endsWith("_s")) return span(Number(value));
  if (name === "at") return moment(value);
  if (name === "event") return t.event[value] ?? value;
  if (name === "state") return t.alarmState[value] ?? value;
  if (name === "quantity" || name === "unit") return t.measured[value] ?? value;
  return /^-?\d+\.\d+(e[-+]?\d+)?$/.test(value) ? local(value) : value;
}

/** Why a request has failed, in words. */
export function failure(error: unknown): string {
  if (isSilence(error)) return t.noAnswer;
  const { message } = error as Error;
  return (error instanceof Refused ? translated(message, error.sentences) : null) ?? message;
}

/** A text of the daemon: in the language of the page, else in English; it may contain names in any script. */
export function Words({ children, by = [] }: { children: string; by?: Sentence[] }) {
  const own = translated(children, by);
  return own === null ? <bdi lang="en">{children}</bdi> : <bdi>{own}</bdi>;
}
