// An alarm in one sentence: in the language of the page, or in English as the daemon words it.
import type { Alarm, Body } from "./ask";
import { moment, unit } from "./format";
import { Words } from "./sentences";
import { t } from "./texts";

/** The sentence as a text, for screen readers. */
export const alarmSentence = (alarm: Alarm): string => t.sentence(alarm, unit(alarm.unit)) ?? alarm.words;

export function AlarmWords({ alarm }: { alarm: Alarm }) {
  const own = t.sentence(alarm, unit(alarm.unit));
  return own === null ? <Words>{alarm.words}</Words> : <bdi>{own}</bdi>;
}

/** A step of an alarm: what happened, and until when it is shelved if that is new. */
export function stepText(step: Body<"AlarmTransition">): string {
  const event = t.event[step.event] ?? step.event;
  if (step.until === null || step.from_state === "shelved" && step.event !== "shelve") return event;
  const until = t.until(moment(step.until));
  return step.event === "shelve" ? `${event} ${until}` : `${event}, ${t.alarmState.shelved} ${until}`;
}

/** When a limit is reached, counted from a time, in a sentence. */
export function Reached({ reach, from }: { reach: Body<"Reach">; from: string }) {
  const own = t.reach(reach, unit(reach.unit), from);
  return own === null ? <Words>{reach.words}</Words> : <bdi>{own}</bdi>;
}

/** The meaning of a parameter; those of the drives of the library are in the language of the page. */
export function meaningOf(text: string): string {
  const inverse = text.startsWith(INVERSE);
  const plain = inverse ? text.slice(INVERSE.length) : text;
  const own = t.meaning(plain);
  return own === null ? text : inverse ? t.reciprocal(own) : own;
}

/** The meaning, marked as English if it is English. */
export function Meaning({ of }: { of: string }) {
  const words = meaningOf(of);
  return words === of ? <Words>{of}</Words> : <bdi>{words}</bdi>;
}

const INVERSE = "reciprocal of: ";
