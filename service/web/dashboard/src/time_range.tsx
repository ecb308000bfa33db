// The range of time of the plots: presets, buttons, keys. Without an end it follows the newest sample.
import type { ComponentChildren } from "preact";
import { moment, zone } from "./format";
import { t } from "./texts";

export interface Span {
  /** Length [s]. */
  length: number;
  /** End [s since 1970]; null: the newest time, whatever it is. */
  end: number | null;
}

const SHORTEST_S = 5;
const LONGEST_S = 10 * 366 * 86400;

/** A span moved by a share of its length; beyond the newest time it follows that time. */
export function moved(span: Span, share: number, now: number): Span {
  const end = (span.end ?? now) + share * span.length;
  return { ...span, end: end >= now ? null : end };
}

/** A span scaled about its middle by this factor; one that follows the newest time keeps its end. */
export function scaled(span: Span, factor: number, now: number): Span {
  const length = Math.min(LONGEST_S, Math.max(SHORTEST_S, span.length * factor));
  if (span.end === null) return { length, end: null };
  const end = span.end + (length - span.length) / 2;
  return { length, end: end >= now ? null : end };
}

interface Props {
  span: Span;
  now: number;
  onChange: (span: Span) => void;
  children: ComponentChildren;
}

export function TimeRange({ span, now, onChange, children }: Props) {
  const keys: Record<string, () => Span> = {
    ArrowLeft: () => moved(span, -0.25, now),
    ArrowRight: () => moved(span, 0.25, now),
    "+": () => scaled(span, 0.5, now),
    "-": () => scaled(span, 2, now),
    Home: () => ({ ...span, end: null }),
  };
  const onKey = (event: KeyboardEvent): void => {
    const change = keys[event.key];
    if (!change || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    onChange(change());
  };
  const end = span.end ?? now;
  const button = (label: string, sign: string, key: string) => (
    <button type="button" aria-label={label} title={label} onClick={() => onChange((keys[key] as () => Span)())}>{sign}</button>
  );
  return (
    <section class="time-range" aria-label={t.range}>
      <div class="tools" role="group" aria-label={t.range} tabIndex={0} onKeyDown={onKey}>
        <div class="choice">
          {t.presets.map(([s, words]) => (
            <button key={s} type="button" aria-pressed={span.length === s} onClick={() => onChange({ length: s, end: span.end })}>{words}</button>
          ))}
        </div>
        <div class="choice">
          {button(t.earlier, "◀", "ArrowLeft")}
          {button(t.later, "▶", "ArrowRight")}
          {button(t.closer, "+", "+")}
          {button(t.wider, "−", "-")}
          <button type="button" aria-pressed={span.end === null} title={t.toLive} onClick={() => onChange({ ...span, end: null })}>{t.live}</button>
        </div>
        <span class="quiet">{moment((end - span.length) * 1000)} – {moment(end * 1000)} ({zone(new Date(end * 1000))})</span>
      </div>
      {children}
    </section>
  );
}
