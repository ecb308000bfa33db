// The language of the page: that of the browser, or the one chosen with the switch.
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
