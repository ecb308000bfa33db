// The dashboard: its header, and the page of the address (#/, #/axes/ID, #/alarms, #/alarms/N, #/system); or /docs.
import { render } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { AlarmList } from "./alarm_list";
import { AlarmPage } from "./alarm_page";
import { alarmSentence } from "./alarm_words";
import { SoundSwitch } from "./alarm_sound";
import { hasToken, type Alarm, type Body } from "./ask";
import { AxisPage } from "./axis_page";
import { CommissioningPage } from "./commissioning_page";
import { Docs } from "./docs";
import { span, zone } from "./format";
import { language } from "./language";
import { silence, start, useLive, type Live } from "./live";
import { isHidden, keyOf } from "./need";
import { Overview } from "./overview";
import "./page.css";
import { translated, Words } from "./sentences";
import { SignIn } from "./sign_in";
import { SystemPage } from "./system_page";
import { choose, t } from "./texts";

function useAddress(): string[] {
  const read = (): string[] => location.hash.replace(/^#\/?/, "").split("/").map((part) => {
    try {
      return decodeURIComponent(part);
    } catch {
      return part;
    }
  });
  const [address, set] = useState(read);
  useEffect(() => {
    const change = (): void => {
      set(read());
      scrollTo(0, 0);
    };
    addEventListener("hashchange", change);
    return () => removeEventListener("hashchange", change);
  }, []);
  return address;
}

function App() {
  const [page = "", name] = useAddress();
  const live = useLive();
  const [, redraw] = useState(0);
  const gone = live.locked === null ? silence(live) : null;
  useTitle(live, gone);
  const other = (): void => {
    choose(language() === "en" ? "de" : "en");
    redraw((n) => n + 1);
  };
  return (
    <div class={(live.locked ?? gone) !== null ? "stale" : ""} key={language()}>
      <a class="skip" href="#main" onClick={toMain}>{t.skip}</a>
      <Header {...{ live, gone, page, other }} />
      {/* Not before the header has its messages: they would move what is about to be clicked. */}
      <main id="main" tabIndex={-1}>{(live.locked ?? gone ?? live.answered) !== null && <Content {...{ page, name }} />}</main>
      <footer class="quiet"><p>{t.zone(zone())}</p></footer>
    </div>
  );
}

/** The address selects the page: a link to the content must not change it. */
function toMain(event: MouseEvent): void {
  event.preventDefault();
  document.getElementById("main")?.focus();
}

function Content({ page, name }: { page: string; name: string | undefined }) {
  if (page === "axes" && name) return <AxisPage key={name} id={name} />;
  if (page === "alarms") return name ? <AlarmPage key={name} id={name} /> : <AlarmList />;
  if (page === "system") return name === "commissioning" ? <CommissioningPage /> : <SystemPage />;
  return <Overview />;
}

interface HeaderProps {
  live: Live;
  gone: number | null;
  page: string;
  other: () => void;
}

function Header({ live, gone, page, other }: HeaderProps) {
  const { service } = live;
  const shown = live.active.filter((alarm) => !isHidden(alarm)).length;
  const link = (to: string, words: string, here: boolean) => <a href={to} aria-current={here ? "page" : undefined}>{words}</a>;
  return (
    <header>
      <div class="bar-top">
        <a class="brand" href="#/"><img src="/static/icon.svg" alt="" width="24" height="24" /> axiswatch</a>
        <nav aria-label={t.pages.overview}>
          {link("#/", t.pages.overview, page === "" || page === "axes")}
          {link("#/alarms", shown > 0 ? `${t.pages.alarms} (${shown})` : t.pages.alarms, page === "alarms")}
          {link("#/system", t.pages.system, page === "system")}
        </nav>
        <State {...{ live, gone }} />
        <nav class="more" aria-label={t.pages.api}>
          {service?.report && <a href={service.report}>{t.pages.report}</a>}
          <a href="/docs">{t.pages.api}</a>
          {!hasToken() && <a href="/metrics">{t.pages.metrics}</a>}
          <SoundSwitch active={live.active} answered={live.answered !== null} />
          <button type="button" class="plain" lang={language() === "en" ? "de" : "en"} onClick={other}>{t.otherLanguage}</button>
        </nav>
      </div>
      {service?.insecure && <p id="insecure" class="banner warn"><Words by={service.sentences}>{service.insecure}</Words></p>}
      {gone !== null && <Gone {...{ live, gone }} />}
      {live.locked !== null && <SignIn why={live.locked} />}
      {gone === null && <Sentences id="reasons" label={t.reasons} kind="warn" words={(service?.not_ready ?? []).map((reason) => reasonWords(reason, service?.sentences ?? []))} />}
      <Sentences id="messages" label={t.messages} kind="note" words={service?.messages ?? []} by={service?.sentences ?? []} />
      <News active={live.active} answered={live.answered !== null} />
    </header>
  );
}

function State({ live, gone }: { live: Live; gone: number | null }) {
  const ready = live.service?.ready ?? false;
  const words = live.locked !== null ? t.tokenNeeded : gone !== null ? t.noAnswer
    : live.service === null ? t.connecting : ready ? t.ready : t.notReady;
  const kind = gone !== null ? "bad" : live.locked !== null || (live.service !== null && !ready) ? "warn" : "";
  return <p id="state" class={`pill ${kind}`} role="status">{words}</p>;
}

function Gone({ live, gone }: { live: Live; gone: number }) {
  const why = live.failure === "" || live.failure === "-" ? "" : ` (${live.failure})`;
  return (
    <p id="lost" class="banner bad" role="alert">
      {t.noDataFor(span(Math.floor(gone) < 10 ? Math.round(gone * 10) / 10 : gone))}{why}. {live.answered === null ? t.noAnswerYet : t.lastValues}
    </p>
  );
}

const MOST_SENTENCES = 3;

/** Reasons why not everything is monitored or recorded. */
function reasonWords({ lack, name, state, since_s, alarms }: Body<"NotReady">, sentences: Body<"Sentence">[]): string {
  const since = since_s === null ? null : span(since_s);
  if (lack === "bus") return t.lacks.bus(name, translated(state, sentences) ?? state);
  if (lack === "record") return t.lacks.record(alarms);
  return lack === "worker" ? t.lacks.worker(since ?? "?") : t.lacks.samples(name, since);
}

/** The first ones of many; the others appear after a click. */
interface SentencesProps {
  id: string;
  label: string;
  kind: string;
  words: string[];
  /** Source of the texts in the daemon, from which they are translated to the language of the page. */
  by?: Body<"Sentence">[];
}

function Sentences({ id, label, kind, words, by }: SentencesProps) {
  const [all, setAll] = useState(false);
  if (words.length === 0) return null;
  const shown = all ? words : words.slice(0, MOST_SENTENCES);
  return (
    <ul id={id} class={`banner ${kind}`} aria-label={label}>
      {shown.map((sentence) => <li key={sentence}>{by ? <Words by={by}>{sentence}</Words> : <bdi>{sentence}</bdi>}</li>)}
      {shown.length < words.length && (
        <li><button type="button" class="plain" onClick={() => setAll(true)}>{t.more(words.length - shown.length)}</button></li>
      )}
    </ul>
  );
}

/** Announces new alarms, and alarms with a new name, to screen readers. */
function News({ active, answered }: { active: Alarm[]; answered: boolean }) {
  const known = useRef<Map<string, string> | null>(null);
  const [words, say] = useState("");
  useEffect(() => {
    if (!answered) return;
    const shown = active.filter((alarm) => !isHidden(alarm));
    const nameOf = (alarm: Alarm): string => `${alarm.stage} ${alarm.parameter}`;
    const before = known.current;
    known.current = new Map(shown.map((alarm) => [keyOf(alarm), nameOf(alarm)]));
    if (before === null) return;
    const fresh = shown.filter((alarm) => before.get(keyOf(alarm)) !== nameOf(alarm));
    if (fresh.length === 0) return;
    say(fresh.map((a) => (before.has(keyOf(a)) ? t.alarmNamed : t.newAlarm)(a.axis, alarmSentence(a))).join("; "));
  }, [active, answered]);
  return <p id="news" class="unseen" role="status" aria-live="assertive">{words}</p>;
}

/** The number of active alarms in title and icon. */
function useTitle(live: Live, gone: number | null): void {
  const shown = live.active.filter((alarm) => !isHidden(alarm)).length;
  const title = live.locked !== null ? `${t.tokenNeeded} – axiswatch` : gone !== null ? `${t.noAnswer} – axiswatch`
    : shown > 0 ? `(${shown}) axiswatch` : "axiswatch";
  const icon = shown === 0 ? "icon" : `icon-${shown > 9 ? "9+" : shown}`;
  useEffect(() => {
    document.title = title;
    const link = document.querySelector<HTMLLinkElement>("link[rel=icon]");
    if (link && !link.href.endsWith(`/${icon}.svg`)) link.href = `/static/${icon}.svg`;
  }, [title, icon]);
}

const ofApi = location.pathname === "/docs";
if (!ofApi) start();
const place = document.getElementById("app");
if (place) render(ofApi ? <Docs /> : <App />, place);
