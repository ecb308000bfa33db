// The texts of the page: one file for each language.
import { keep, language, type Language } from "../language";
import { de } from "./de";
import { en, type Texts } from "./en";

const ALL: Record<Language, Texts> = { en, de };

/** The texts of the present language. */
export let t: Texts = ALL[language()];

export function choose(to: Language): void {
  keep(to);
  t = ALL[to];
  document.documentElement.lang = to;
}

if (globalThis.document) document.documentElement.lang = language();
