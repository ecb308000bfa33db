// The language of the page: of the browser, or as it was chosen by the switch.
export type Language = "en" | "de";

const KEY = "axiswatch-language";

function preferred(): Language {
  const kept = globalThis.localStorage?.getItem(KEY);
  if (kept === "en" || kept === "de") return kept;
  return globalThis.navigator?.language.toLowerCase().startsWith("de") ? "de" : "en";
}

let chosen: Language = preferred();

export const language = (): Language => chosen;

export function keep(to: Language): void {
  chosen = to;
  globalThis.localStorage?.setItem(KEY, to);
}
