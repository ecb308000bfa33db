// The texts of the page: one file for each language, chosen by the browser's language or by the switch.
import { de } from "./de";
import { en, type Texts } from "./en";

export type Language = "en" | "de";

const KEY = "axiswatch-language";
const ALL: Record<Language, Texts> = { en, de };

function preferred(): Language {
  const kept = globalThis.localStorage?.getItem(KEY);
  if (kept === "en" || kept === "de") return kept;
  return globalThis.navigator?.language.toLowerCase().startsWith("de") ? "de" : "en";
}

let chosen: Language = preferred();
/** The texts of the present language. */
export let t: Texts = ALL[chosen];

export const language = (): Language => chosen;

export function choose(to: Language): void {
  chosen = to;
  t = ALL[to];
  globalThis.localStorage?.setItem(KEY, to);
  document.documentElement.lang = to;
}

if (globalThis.document) document.documentElement.lang = chosen;
