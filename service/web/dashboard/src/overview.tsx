// All axes on one screen, the most urgent first.
import { Component } from "preact";
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Alarm, Axis } from "./ask";
import { AlarmWords, Meaning } from "./alarm_words";
import { epochWords } from "./epochs";
import { span } from "./format";
import { useLive, ageOf } from "./live";
import { alarmLink, AlarmMark, axisLink, Bar, barText, shareText, estimateText, hiddenText, kindOf, NeedMark, needText, stateOf, Time } from "./marks";
import { isHidden, itemsOf, matches, NEEDS, ordered, urgency, type Item, type Need } from "./need";
import { t } from "./texts";
import { GAP, layoutOf } from "./tile_layout";
import { useInTurns } from "./turns";

const LINES = 3; // alarms above the tiles
const MARGIN = 8; // below the tiles [px]
const BESIDE = 14; // a name in a small tile: its margins [px]
const MARK = 20;
const BOLD = 1.15; // times the width

export function Overview() {
  const live = useLive();
  const [search, setSearch] = useState("");
  const [shown, setShown] = useState<Need | "all">("all");
  const [order, setOrder] = useState<"need" | "name">("need");
  const items = useMemo(() => itemsOf(live.axes, live.active), [live.axes, live.active]);
  const found = useMemo(() => items.filter((item) => matches(item, search)), [items, search]);
  const chosen = useMemo(
    () => ordered(found.filter((item) => shown === "all" || item.need === shown), order), [found, shown, order],
  );
  const numbers = (need: Need | "all"): number => found.filter((item) => need === "all" || item.need === need).length;
  const field = useRef<HTMLInputElement>(null);
  useEffect(() => {
    const onKey = (event: KeyboardEvent): void => {
      if (event.key !== "/" || event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement) return;
      event.preventDefault();
      field.current?.focus();
    };
    addEventListener("keydown", onKey);
    return () => removeEventListener("keydown", onKey);
  }, []);
  return (
    <>
      <h1 class="unseen">{t.pages.overview}</h1>
      <AlarmLines alarms={live.active.filter((alarm) => !isHidden(alarm))} axes={live.axes} />
      <div class="tools">
        <input ref={field} type="search" placeholder={`${t.search}  /`} aria-label={t.search} value={search}
          onInput={(event) => setSearch(event.currentTarget.value)} onKeyDown={toFirstTile} />
        <div class="choice" role="group" aria-label={t.filter}>
          {(["all", ...NEEDS] as const).map((need) => (
            <button key={need} type="button" aria-pressed={shown === need} onClick={() => setShown(need)}>
              {t.needs[need]} <b>{numbers(need)}</b>
            </button>
          ))}
        </div>
        <label class="order">{t.sort}
          <select value={order} onChange={(event) => setOrder(event.currentTarget.value as "need" | "name")}>
            <option value="need">{t.sortNeed}</option>
            <option value="name">{t.sortName}</option>
          </select>
        </label>
      </div>
      {chosen.length > 0 ? <Tiles items={chosen} /> : (
        <p class="quiet">{live.answered === null ? t.waiting : live.axes.length === 0 ? t.noAxis : t.noMatch}</p>
      )}
      <Legend />
    </>
  );
}

/** From the search to what it has found, past the filters between. */
function toFirstTile(event: KeyboardEvent): void {
  const first = document.querySelector<HTMLElement>("a.tile");
  if (first === null || !(event.key === "ArrowDown" || event.key === "Enter")) return;
  event.preventDefault();
  first.focus();
}

function AlarmLines({ alarms, axes }: { alarms: Alarm[]; axes: Axis[] }) {
  if (alarms.length === 0) return null;
  const urgent = [...alarms].sort((a, b) => urgency(a) - urgency(b)); // else the latest first, as the daemon has them
  const meanings = new Map(axes.flatMap((axis) => axis.parameters.map((p) => [axis.id + p.name, p.meaning])));
  return (
    <ul class="alarm-lines" aria-label={t.activeAlarms(alarms.length)}>
      {urgent.slice(0, LINES).map((alarm) => (
        <li key={`${alarm.axis} ${alarm.raised} ${alarm.parameter}`}>
          <AlarmMark alarm={alarm} />
          <a class="axis-name" href={axisLink(alarm.axis)}><bdi>{alarm.axis}</bdi></a>
          <a class="sentence" href={alarmLink(alarm.id)}><AlarmWords alarm={alarm} /></a>
          <span class="quiet">
            {meanings.has(alarm.axis + alarm.parameter) && <><Meaning of={meanings.get(alarm.axis + alarm.parameter) ?? ""} />, </>}
            <span class="nowrap">{t.since} <Time at={alarm.onset} /></span>
          </span>
        </li>
      ))}
      {alarms.length > LINES && <li><a href="#/alarms">{t.more(alarms.length - LINES)}</a></li>}
    </ul>
  );
}

/** The size of the area for the tiles: the window below its upper edge. */
function usePlace(): [preact.RefObject<HTMLUListElement | null>, { width: number; height: number }] {
  const place = useRef<HTMLUListElement>(null);
  const [size, setSize] = useState({ width: 0, height: 0 });
  useLayoutEffect(() => {
    const measure = (): void => {
      const node = place.current;
      if (!node) return;
      const seen = node.getBoundingClientRect();
      const zoom = seen.width / node.clientWidth || 1; // of very large screens: it is in what is seen, not in sizes
      const height = Math.max(120, (innerHeight - (seen.top + scrollY)) / zoom - MARGIN);
      setSize((was) => (was.width === node.clientWidth && was.height === height ? was : { width: node.clientWidth, height }));
    };
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(document.body);
    addEventListener("resize", measure);
    return () => {
      observer.disconnect();
      removeEventListener("resize", measure);
    };
  }, []);
  return [place, size];
}

const STEPS: Record<string, (columns: number) => number> = {
  ArrowRight: () => 1, ArrowLeft: () => -1, ArrowDown: (columns) => columns, ArrowUp: (columns) => -columns,
};

function Tiles({ items }: { items: Item[] }) {
  const live = useLive();
  const [place, size] = usePlace();
  const parameters = Math.max(1, ...items.map((item) => item.axis.parameters.length));
  const layout = layoutOf(items.length, parameters, size.width, size.height);
  const room = Math.floor((size.width + GAP) / layout.columns) - GAP - BESIDE;
  const drawn = useInTurns(items, idOf, sameItem);
  const move = (event: KeyboardEvent): void => {
    const links = [...(place.current?.querySelectorAll<HTMLElement>("a.tile") ?? [])];
    const at = links.indexOf(document.activeElement as HTMLElement);
    const step = STEPS[event.key];
    if (at < 0 || !step) return;
    event.preventDefault();
    links[at + step(layout.columns)]?.focus();
  };
  return (
    <ul ref={place} class={layout.wide ? "tiles wide" : "tiles"} aria-label={t.axes} onKeyDown={move}
      style={{ "gap": `${GAP}px`, "grid-template-columns": `repeat(${layout.columns}, minmax(0, 1fr))`, "--bar": `${layout.bar}px`, "--zoom": layout.zoom }}>
      {items.map((item) => (
        <Tile key={item.axis.id} item={drawn.get(item.axis.id) ?? item} known={drawn.has(item.axis.id)}
          wide={layout.wide} room={room} age={layout.wide ? ageText(ageOf(item.axis, live)) : ""} />
      ))}
    </ul>
  );
}

const widths = new Map<string, number>();

/** The width of a name in a small tile [px]. Reading the font computes all styles, so each name is measured once. */
function widthOf(name: string): number {
  let width = widths.get(name);
  if (width === undefined) {
    const pen = document.createElement("canvas").getContext("2d");
    if (pen) pen.font = `12px ${getComputedStyle(document.body).fontFamily}`;
    widths.set(name, (width = pen?.measureText(name).width ?? 0));
  }
  return width;
}

/** The end of a name, which distinguishes axes, as far as it fits. A CSS box that cuts the text would be a layer: if
 * layers lie in a tile, Chromium paints all tiles again when their order changes. */
function endOf(name: string, room: number): string {
  const width = widthOf(name);
  if (width <= room) return name;
  const letters = [...name];
  return `…${letters.slice(letters.length - Math.max(1, Math.floor((letters.length * (room - widthOf("…"))) / width))).join("")}`;
}

const ageText = (age: number | null): string => (age === null ? t.noSample : t.lastSample(span(age)));

/** A wide tile shows since when there is an alarm, the progress of learning, or the age of the last sample. */
function Age({ item: { axis, alarms }, age }: { item: Item; age: string }) {
  if (alarms[0]) return <span class="age">{t.since} <Time at={alarms[0].onset} /></span>;
  return <span class="age"><bdi>{epochWords(axis) || age}</bdi></span>;
}

interface TileProps {
  item: Item;
  /** Whether the tile may be drawn; before that only its name is shown. */
  known: boolean;
  wide: boolean;
  /** For the name on a small one [px]. */
  room: number;
  age: string;
}

/** An unchanged axis is not drawn again. */
class Tile extends Component<TileProps> {
  override shouldComponentUpdate = (next: TileProps): boolean => !sameTile(this.props, next);
  override render = (props: TileProps) => drawnTile(props);
}

function drawnTile({ item, known, wide, room, age }: TileProps) {
  const { axis, need, alarms } = item;
  const words = needText(item) || epochWords(axis) || hiddenText(item) || t.needs.normal;
  // A wide tile shows all this in its own text.
  const label = wide || !known ? undefined : [`${axis.id}: ${words}`, ...axis.parameters.map(barText)].join("; ");
  return (
    <li>
      <a class={`tile ${need} prio-${alarms[0]?.priority ?? "none"}`} href={axisLink(axis.id)} aria-label={label} title={axis.id}>
        <span class="head">
          {alarms[0] ? <AlarmMark alarm={alarms[0]} /> : <NeedMark need={need} />}
          <span class="name">
            {wide ? <><bdi class="robot">{axis.robot}</bdi><bdi>.{axis.name}</bdi></> : <bdi>{endOf(axis.id, need === "normal" ? room : (room - MARK) / (alarms[0] ? BOLD : 1))}</bdi>}
          </span>
          {wide && <span class="state">{words === epochWords(axis) ? t.epochs.state[axis.epoch.state] : words}</span>}
        </span>
        {wide && <Age {...{ item, age }} />}
        {known && axis.parameters.map((p) => (wide ? <WideRow key={p.name} p={p} /> : <Bar key={p.name} p={p} />))}
      </a>
    </li>
  );
}

const idOf = (item: Item): string => item.axis.id;

const sameItem = (a: Item, b: Item): boolean =>
  a.axis === b.axis && a.need === b.need && sameAlarms(a.alarms, b.alarms) && sameAlarms(a.hidden, b.hidden);

const sameAlarms = (a: Item["alarms"], b: Item["alarms"]): boolean => a.length === b.length && a.every((alarm, i) => alarm === b[i]);

function sameTile(a: TileProps, b: TileProps): boolean {
  return a.wide === b.wide && a.room === b.room && a.age === b.age && a.known === b.known && sameItem(a.item, b.item);
}

function WideRow({ p }: { p: Item["axis"]["parameters"][number] }) {
  return (
    <span class={`row ${kindOf(p)}`}>
      <bdi class="parameter">{p.name}</bdi>
      <span class="value">{estimateText(p)}</span>
      <span class="share">{shareText(p)}</span>
      <Bar p={p} />
      <span class="state">{stateOf(p)}</span>
    </span>
  );
}

function Legend() {
  return (
    <p class="legend quiet">
      <span><i class="key tick" /> {t.legend.tick}</span>
      <span><i class="key zone" /> {t.legend.zone}; {t.legend.scale}</span>
      <span>{t.legend.dashed}</span>
      <span>{t.legend.marks}</span>
    </p>
  );
}
