// German. Sentences of the daemon are here by their kinds; what is not, as the text of an error of the system, is English.
import type { Alarm, Body, Parameter } from "../ask";
import { moment, unit as unitOf } from "../format";
import { Z90 } from "../series";
import type { Texts } from "./en";

const comma = (digits: string): string => digits.replace(".", ",");

/** Two digits, all of a whole number. */
const digits = (x: number): string => (Number.isFinite(x) ? comma(Math.abs(x) >= 10 ? x.toFixed(0) : String(Number(x.toPrecision(2)))) : "?");

const ms = (s: number): string => `${digits(1000 * Math.abs(s))} ms`;

const SENSORS: Record<string, (size: number, unit: string) => string> = {
  "torque sign": () => "das gemessene Moment hat sein Vorzeichen gewechselt",
  "output sign": () => "die gemessene Bewegung hat ihr Vorzeichen gewechselt",
  "torque stuck": () => "das gemessene Moment hängt: es bleibt gleich, während ein anderes wirkt",
  "torque lost": () => "das wirkende Moment ist nicht das gemessene: sein Signal fehlt, oder es ist ein anderes",
  "output stuck": () => "die gemessene Bewegung hängt: sie wiederholt sich in jeder Ziffer",
  "torque scale": (size) => `das wirkende Moment ist dem Maßstab nach ${share(size)} als das gemessene`,
  "output scale": (size) => `die gemessene Bewegung ist dem Maßstab nach ${share(size)} als die wahre`,
  "torque offset": (size, unit) => `das wirkende Moment ist stets um ${digits(Math.abs(size))} ${unit} ${greater(size)} als das gemessene`,
  "output offset": (size, unit) => `die gemessene Bewegung ist stets um ${digits(Math.abs(size))} ${unit} ${greater(size)} als die wahre`,
  "output noise": (size) => `die gemessene Bewegung rauscht um ${digits(Math.abs(100 * size))} % mehr als zuvor`,
};

const MOTION = "Bewegung, die beschleunigt und mehrere Geschwindigkeiten hat, innerhalb von memory_s, oder ein längeres memory_s";

/** Warum Parameter nicht geprüft werden, und was dafür nötig ist. */
const NOT_TESTED: Record<NonNullable<Parameter["not_tested_reason"]>, [string, string]> = {
  "no sample": ["es kommt kein Messwert", "Moment und Bewegung dieser Achse; `axiswatch listen` zeigt, was ankommt"],
  settling: ["der Prädiktor schwingt nach Start, Lücke oder verlorenen Messwerten ein", "lückenlose Messwerte, länger als settling_time_s"],
  "operating conditions": [
    "die Betriebsbedingungen schließen die Messwerte aus",
    "Messwerte, bei denen jedes Tor offen und jedes Signal bekannt und in seinem Bereich ist",
  ],
  "warm-up state": ["wie warm die Achse nach Start oder Pause ist, ist noch nicht bekannt; ihre Reibung zeigt es", "Messwerte, bis ihre Reibung oder die Zeit es zeigt; oder `start = \"cold\"` in [robot.axis.thermal], wenn sie kalt beginnt"],
  unidentifiable: [
    "die Aufnahme für die Nennwerte bestimmt sie nicht",
    "Nennwerte aus einer Aufnahme mit mehreren Geschwindigkeiten und Beschleunigungen, oder `axiswatch identify --fix` mit einem von ihnen, der dann unverändert bleibt",
  ],
  seeding: ["die Bewegung reicht noch nicht für den Anfang der Schätzung", "mehr Bewegung, oder ein kürzeres memory_s"],
  "not observed": ["die Bewegung enthält fast keine Information darüber", MOTION],
  uncertain: [
    "innerhalb von memory_s enthält die Bewegung so wenig Information, dass selbst eine Änderung um den ganzen Wert nicht gefunden würde",
    `${MOTION}; oder sie aus \`monitor\` zu nehmen`,
  ],
  blocked: ["die Prüfung kann nicht beginnen, weil ein anderer Parameter innerhalb von memory_s nicht bestimmbar ist", `jenen aus \`monitor\` zu nehmen; oder ${MOTION}`],
  "no threshold": ["der Mehrmodell-Detektor hat keine Schwelle", "eine neue Kalibrierung, `axiswatch calibrate`"],
};

const greater = (size: number): string => (size < 0 ? "kleiner" : "größer");
const share = (size: number): string => `um ${digits(Math.abs(100 * size))} % ${greater(size)}`;

/** Moment und Bewegung gehören nicht mehr zum selben Zeitpunkt. */
function delayed(size: number, nominal: number): string {
  const way = nominal ? (size > 0 ? "später als üblich" : "früher als üblich") : size > 0 ? "zu spät" : "zu früh";
  if (!Number.isFinite(size)) return `der Frame des Moments kommt ${way}, um wie viel, ist nicht bekannt`;
  const acts = nominal ? ms(nominal + size) : "um so viel";
  return `der Frame des Moments kommt ${ms(size)} ${way}: das Moment wirkt ${acts} ${nominal + size > 0 ? "nach" : "vor"} seinem Messwert`;
}

/** Eine relative Änderung, "um 19 % kleiner"; nur die Richtung, wenn ihre Größe nicht bekannt ist. */
const relative = (size: number): string => (Number.isFinite(size) ? share : greater)(size);

/** Was eine andere Trägheit bedeutet, wenn die Achse nichts anderes trägt. */
const otherwise = (size: number): string => `; sonst ist kT ${relative(size > -1 && size < Infinity ? -size / (1 + size) : -size)}`;

function fact(alarm: Alarm, unit: string): string {
  const nominal = alarm.nominal ?? 0;
  const size = alarm.size ?? (alarm.direction === "down" ? -Infinity : Infinity);
  const sensor = SENSORS[alarm.parameter];
  if (sensor) return sensor(size, unit);
  if (alarm.parameter === "delay") return delayed(size, nominal);
  const inertia = alarm.parameter === "inertia";
  if (inertia || alarm.parameter === "load") {
    const what = inertia ? "Trägheit, die die Achse bewegt," : "Last an der Achse";
    return `die ${what} ist ${relative(size)} als bei der Inbetriebnahme: eine andere Nutzlast, kein Fehler des Antriebs${inertia ? otherwise(size) : ""}`;
  }
  const side = size < 0 ? "unter" : "über";
  if (!Number.isFinite(size)) return `${alarm.parameter} liegt ${side} dem Nennwert, um wie viel, ist nicht bekannt`;
  const scale = nominal ? 100 / Math.abs(nominal) : 1;
  const known = [...(nominal ? [`${digits(scale * Math.abs(size))} %`] : []), ...interval(scale * Math.abs(size), scale * (alarm.size_sd ?? NaN))];
  const part = known.length > 0 ? ` (${known.join(", ")})` : "";
  return `${alarm.parameter} liegt ${[digits(Math.abs(size)), unit].filter(Boolean).join(" ")}${part} ${side} dem Nennwert`;
}

/** Worin die Größe mit 90 % Wahrscheinlichkeit liegt; leer: kaum bekannt, oder nicht von ihr zu unterscheiden. */
function interval(size: number, sd: number): string[] {
  const [low, high] = [digits(size - Z90 * sd), digits(size + Z90 * sd)];
  return sd < VAGUE * size && low !== high ? [`${low} bis ${high}`] : [];
}

const VAGUE = 5;
const SURE = 0.95;
const LIKELY = 0.9;

// --- Wie im Dienst (service/texts) ------------------------------------------------------------------------------------

/** Jede mit der längsten Zeit, die in ihr angegeben wird, in Sekunden. */
const SPANS: [number, string, number][] = [
  [1, "Sekunden", 120], [60, "Minuten", 7200], [3600, "Stunden", 72 * 3600], [86400, "Tagen", 730 * 86400],
  [365.25 * 86400, "Jahren", Infinity],
];
const DATED_MS = 1e12;

const amount = (value: number | null, unit: string, length = 4): string =>
  [comma(String(Number((value ?? NaN).toPrecision(length)))), unit].filter(Boolean).join(" ");

/** 12 bis 20 Tagen, in der Einheit der letzten. */
function times(...seconds: number[]): string {
  const last = seconds.at(-1) ?? 0;
  const [scale, name] = SPANS.find(([, , most]) => last <= most) ?? [1, "Sekunden"];
  return `${seconds.map((s) => comma((s / scale).toFixed(s / scale >= 9.95 ? 0 : 1).replace(/\.0$/, ""))).join(" bis ")} ${name}`;
}

function reach(r: Body<"Reach">, unit: string, from: string): string {
  const [start, low] = [Date.parse(from), Date.parse(r.low)];
  const high = r.high === null ? null : Date.parse(r.high);
  const after = (at: number): number => Math.max(0, (at - start) / 1000);
  const limit = amount(r.limit, unit);
  if (r.state === "beyond") {
    const [first, last] = [moment(low), moment(high ?? low)];
    const dated = first === last ? `seit ${first}` : `seit einem Zeitpunkt zwischen ${first} und ${last}`;
    const ago = `seit ${times(Math.max(0, (start - (high ?? low)) / 1000), Math.max(0, (start - low) / 1000))}`;
    return `${r.name} liegt ${low >= DATED_MS ? dated : ago} ${r.above ? "über" : "unter"} ${limit}`;
  }
  if (r.state === "far") return `${r.name} = ${limit} ist nicht in Sicht: nicht innerhalb von ${times(after(low))}`;
  if (high === null) return `${r.name} erreicht ${limit} in ${times(after(low))} oder später, vielleicht nie`;
  return `${r.name} erreicht ${limit} in ${times(after(low), Math.max(after(low), after(high)))}`;
}

function course(p: Body<"LongTermHistory">, unit: string): string {
  const t = p.drift;
  if (t === null) return `${p.name}: noch zu wenig Daten für eine Drift`;
  const [steady, step, both] = [t.steady ?? 0, t.step ?? 0, t.both ?? 0];
  const drift = (t.drift ?? 0) + both;
  const slope = t.slope_per_day ?? NaN;
  const perDay = `${amount(Math.abs(slope), unit, 2)} ± ${amount(t.slope_per_day_sd, "", 2)} pro Tag`;
  const way = slope > 0 ? "oben" : "unten";
  const changed = Date.parse(t.changed);
  const when = changed >= DATED_MS ? `um ${moment(changed)}` : `etwa ${times((Date.parse(t.time) - changed) / 1000)} vor dem Ende`;
  if (drift >= LIKELY) return `${p.name} driftet um ${perDay} nach ${way}${both > drift - both ? `, seit einer Änderung ${when}` : ""}`;
  if (steady >= LIKELY) return `${p.name} ist stetig: ${amount(t.level, unit)} ± ${amount(t.level_sd, "", 2)}`;
  const size = `${amount(Math.abs(t.change ?? NaN), unit, 2)} ± ${amount(t.change_sd, "", 2)}`;
  if (step >= LIKELY) return `${p.name} ist ${when} auf einmal um ${size} ${(t.change ?? 0) > 0 ? "gestiegen" : "gefallen"}`;
  const kinds: [string, number][] = [["stetig", steady], ["Drift", drift], ["Sprung", step]];
  const likely = kinds.sort((a, b) => b[1] - a[1]).filter(([, share]) => share >= 0.05);
  const shares = likely.map(([, share]) => (100 * share).toFixed(0)).join(":");
  return `${p.name}: ${likely.map(([kind]) => kind).join(" oder ")}, ${shares}; im Mittel um ${perDay} nach ${way}`;
}

function sentence(alarm: Alarm, unit: string): string | null {
  const outside = alarm.inside_calibration === false ? "; außerhalb der Bedingungen der Kalibrierung ausgelöst" : "";
  if (alarm.stage === "changed") {
    return `etwas hat sich geändert, auf den ersten Blick ${nameOf(alarm.parameter)}; Ursache und Größe ${alarm.ended ? "wurden" : "sind noch"} nicht bekannt${outside}`;
  }
  const words = fact(alarm, unit);
  if (alarm.reaches.length > 0) {
    return [...alarm.reaches.map((r) => reach(r, unitOf(r.unit), alarm.updated)), `jetzt: ${words}`].join("; ");
  }
  const doubts: Record<string, string> = {
    several: `mehr als ein Parameter hat sich geändert, oder keiner; am nächsten liegt ${nameOf(alarm.parameter)}: ${words}`,
    model: `das Modell gilt nicht mehr, wie bei einem Sensorfehler; am nächsten liegt ${nameOf(alarm.parameter)}: ${words}`,
    sign: "die Bewegung folgt dem Moment nicht, als hätte eines von beiden das Vorzeichen gewechselt oder hinge",
    still: "auf das Moment folgt keine Bewegung: Sensor oder Achse hängt, oder der Antrieb ist aus",
  };
  if (alarm.doubt) return `${doubts[alarm.doubt] ?? words}${outside}`;
  const [first] = alarm.causes;
  const likely = alarm.causes.slice(0, 3);
  const which = first === undefined || (first.probability ?? 0) >= SURE ? ""
    : `${likely.map((cause) => nameOf(cause.parameter)).join(" oder ")}, ${likely.map((cause) => (100 * (cause.probability ?? 0)).toFixed(0)).join(":")}; `;
  const drifts = alarm.kind === "drift" ? `, und driftet nach ${alarm.direction === "up" ? "oben" : "unten"}` : "";
  const alike = alarm.causes.find((cause) => cause.parameter === alarm.parameter)?.alike ?? [];
  const same = alike.length > 0 ? `; gleich sähe aus: ${alike.map((name) => (name === "load" ? "eine andere Nutzlast" : nameOf(name))).join(" oder ")}` : "";
  const also = alarm.same_payload.length === 0 ? ""
    : `; ${alarm.same_payload.join(", ")} zur selben Zeit ebenso: eine andere Nutzlast ist wahrscheinlicher als je ein Fehler`;
  return `${which}${words}${drifts}${same}${also}${outside}`;
}

const CAUSES: Record<string, string> = {
  "torque sign": "Vorzeichen des Moments", "torque stuck": "Moment hängt", "torque lost": "Moment fehlt",
  "torque scale": "Maßstab des Moments", "torque offset": "Versatz des Moments", "output sign": "Vorzeichen der Bewegung",
  "output stuck": "Bewegung hängt", "output scale": "Maßstab der Bewegung", "output offset": "Versatz der Bewegung",
  "output noise": "Rauschen der Bewegung", delay: "Verzögerung des Moments", load: "Last", inertia: "Trägheit der Last",
  "a warmer or colder gearbox": "ein wärmeres oder kälteres Getriebe",
  "a gearbox that starts colder or warmer than in its records": "ein Getriebe, das kälter oder wärmer anläuft als in seinen Aufnahmen",
  "a gearbox that becomes warmer than in its records": "ein Getriebe, das wärmer wird als in seinen Aufnahmen",
};

const nameOf = (cause: string): string => CAUSES[cause] ?? cause;

const BUS_UP = "einschalten mit `ip link set {channel} up`";
const NO_TLS = "was gesendet wird, kann unterwegs gelesen und verändert werden (kein TLS)";
const NO_TOKEN = "ungeschützt: Jeder, dessen Rechner diese Adresse erreicht, darf ohne Token lesen und bedienen";
const CLOCK = "Die Uhr dieses Rechners wurde um {by_s}";
const CLOCK_AFTER = "gestellt; {at} ist die erste Zeit danach. Ein Alarm von vorher endet so lange nach seiner Auslösung, wie er gedauert hat";

/** Sätze des Dienstes nach ihrer Art; tests/service/texts/test_sentences.py hält sie und ihre Werte gleich. */
const SENTENCES: Record<string, string> = {
  "not observed": "{name} ist nicht beobachtet",
  alike: "{first} und {last} sind nicht zu unterscheiden",
  unidentifiable: "{first} und {second} sind durch die Aufnahme für ihre Nennwerte nicht zu unterscheiden: nichts wird geprüft."
    + " Die Achse mit einer Aufnahme mit mehreren Geschwindigkeiten und Beschleunigungen identifizieren, oder mit"
    + " `axiswatch identify --fix {second}`, das diesen auf seinem Wert in der Konfiguration hält",
  value: "{name} = {value}",
  "not known": "{name} ist nicht bekannt",
  brake: "von der Bremse gehalten: steht, und der Motor trägt das Gewicht nicht",
  slow: "langsamer als {speed} rad/s",
  "gate settles": "{name} war vor weniger als {time} s anders",
  bounds: "{name} würde seine Grenzen verlassen",
  beyond: "{found}, außerhalb von {low} bis {high}",
  heat: "Wärme = {heat}, Reibung bekannt von {low} bis {high}",
  "not calibrated": "{name} = {value}, kalibriert von {low} bis {high}",
  "new poses": "{share} % des Weges der Achse liegen in Posen des Roboters, die keine Kalibrieraufnahme enthält",
  wider: "{why}: mit größerer Toleranz geprüft",

  "not opened": "gestört: noch nicht geöffnet",
  down: "gestört: {why}",
  closed: "geschlossen",
  "adapter down": "gestört: die Schnittstelle ist ausgeschaltet; einschalten mit der Bitrate des Busses, bei 500 kbit/s:"
    + " `ip link set {channel} up type can bitrate 500000`",
  "interface down": `gestört: die Schnittstelle ist ausgeschaltet; ${BUS_UP}`,
  "interface gone": "gestört: die Schnittstelle ist weg; wird wieder geöffnet, sobald das geht",
  "bus fault": "gestört: {why}; wird wieder geöffnet, sobald das geht",
  "only errors": "gestört: seit den letzten Daten nur Fehlerframes; stimmen Bitrate, Kabel und Abschluss?",
  "reader stopped": "gestört: der Leser hat aufgehört, was ein Fehler des Programms ist",
  "of bus": "Bus {bus}: {why}",
  "no interface": "die Schnittstelle {interface} geht hier nicht: {why}",
  "no device": "es gibt keine Netzwerkschnittstelle {channel}: den Adapter anschließen, oder für eine virtuelle"
    + " `ip link add dev {channel} type vcan && ip link set {channel} up`",
  "no CAN": "dieser Kernel hat kein CAN (modprobe can-raw)",
  "cannot open": "{where} lässt sich nicht öffnen: {why}",

  compiling: "Der numerische Kern wird übersetzt; Frames warten, bis er fertig ist",
  "compiling multimodel": "Der Kern des Multimodell-Detektors wird übersetzt; dessen Messwerte warten, bis er fertig ist",
  "out of service": "Außer Betrieb, Alarme werden gespeichert, aber nicht gemeldet: {axes}",
  "configuration refused": "{file} wurde um {at} abgelehnt: {problem}{further}. Die bisherige Konfiguration gilt weiter",
  "certificate expires": "{file}, das Zertifikat von {table}, läuft ab: {at}. Ein neues an seine Stelle legen und {then}",
  "certificate expired": "{file}, das Zertifikat von {table}, ist abgelaufen: {at}. Clients lehnen die Verbindung ab."
    + " Ein neues an seine Stelle legen und {then}",
  "certificate reload": "axiswatch neu laden (SIGHUP)",
  "certificate restart": "axiswatch neu starten",
  "more mistakes": "; Fehler darin: {count}",
  "clock set back": `${CLOCK} zurück${CLOCK_AFTER}`,
  "clock set forward": `${CLOCK} vor${CLOCK_AFTER}`,
  link: "Verbindung {name}: {why}",
  "link begins": "noch nicht verbunden",
  "link answers": "{place} antwortet {answer}",
  "link no answer": "{place}: keine Antwort in {seconds} s",
  "link takes none": "{place} nimmt keine Nachricht an {receivers} an",
  "nobody let in": "niemand wird eingelassen: es gibt kein Token (axiswatch token new NAME --scope read)",
  "alarms wait": "noch nicht gespeicherte Alarme: {alarms}",
  "alarm not recorded": "Alarm von {alarms}: kann noch nicht gespeichert werden, wird wieder versucht: {why}",
  "frames not recorded": "Rohdaten um einen Alarm sind noch nicht aufgezeichnet: {why}",
  "recording ended": "Die Aufzeichnung ist beendet: {why}",
  "no frames kept": "recordings_mb in [service] ist 0: es werden keine Rohdaten aufbewahrt",
  "history failed": "Die Geschichte wird nicht mehr geschrieben: ein Fehler des Programms, siehe Log",
  "history not written": "Die Geschichte kann noch nicht geschrieben werden, es wird wieder versucht: {why}",
  "not saved": "Der Zustand der Überwachung kann nicht gespeichert werden: {why}",
  unmonitored: "{axis}: der Alarm von {name} wurde beendet: das wird nicht mehr überwacht",
  "not used": "{axis}: der gesicherte Zustand wird nicht verwendet und wurde beiseitegelegt: {why}",
  "part not used": "{axis}: ein Teil des gesicherten Zustands wird nicht verwendet und wurde beiseitegelegt: {why}",
  lost: "{why} (neu begonnen: {parts})",
  "part of": "{part} von {names}",
  "part estimates": "die Schätzwerte",
  "part evidence": "die Teststatistik des Multimodell-Detektors",
  "part warmth": "der Wärmezustand",
  "part window": "das Lernfenster",
  "part history": "die Langzeitgeschichte",
  damaged: "er ist beschädigt (falsche Prüfsumme)",
  version: "er passt nicht zu dieser Version ({why})",
  unreadable: "er ist nicht lesbar ({why})",
  "other settings": "er gehört zu einem anderen Modell, anderen Parametern, anderen Einstellungen oder einer anderen Version",
  "other epoch": "er gehört zu {before}, nicht zu {now}",
  epoch: "Epoche {number}",
  "the configuration": "der Konfiguration",
  "file gone": "{path} ist nicht mehr da: wieder hinlegen, oder axiswatch neu starten, das dann eine neue Datei beginnt",
  "file replaced": "{path} wurde durch eine andere Datei ersetzt: die frühere wieder hinlegen, oder axiswatch neu starten",
  "file damaged": "{path} ist beschädigt ({why}); die Datei heißt jetzt {name}, und eine neue wurde begonnen",
  "configuration changed": "{axis}: die Konfiguration wurde geändert, seit Epoche {before} begann: sie gilt, als Epoche {epoch};"
    + " `axiswatch baseline restore {axis} {before}` nimmt das zurück",
  "epoch in force": "{axis}: es gelten die Nennwerte von Epoche {epoch}, nicht die der Konfiguration",
  "epoch does not fit": "Epoche {epoch} passt nicht mehr zur Konfiguration, deshalb gilt diese: {why}",
  "begins again": "{axis}: das Lernfenster von Epoche {epoch} beginnt von vorn",

  "no token": NO_TOKEN,
  "no token, no TLS": `${NO_TOKEN}; ${NO_TLS}`,
  "no TLS": `ungeschützt: ${NO_TLS}, auch Token`,
  "token needed": "Es wird ein Token gebraucht, wie ihn `axiswatch token new` macht: Authorization: Bearer TOKEN",
  "token not known": "Dieser Token ist nicht bekannt oder wurde widerrufen",
  scope: "Das braucht einen Token mit dem Umfang {scope}; der von {name} hat weniger",
  "no frames yet": "Noch von keinem Bus kam ein Frame: sie schweigen, oder der Dienst startet noch",
  "frames old": "Seit {age_s} ist nichts gekommen: was folgt, ist von davor",
  "message absent": "Kein {names}: die Nachricht {message} ({number}) kam in {seconds} s nicht auf dem Bus {bus}; ist die Achse an, und ist das ihre Nachricht?",
  "no samples": "Ihre Frames ergeben keine Messwerte: {reason}; siehe sample_interval_s, pairing_tolerance_s und die Nachrichten",
  "motion constant": "Die Bewegung ist stets {value}, während das Moment sich ändert: {motion} hängt, oder die Bewegung ist ein anderes Signal; oder die Achse steht: {still}",
  "axis stands": "Sie bewegt sich nicht: {still}",
  "move it": "den Roboter arbeiten lassen, oder eine Bewegung fahren, die `axiswatch excite` plant",
  "torque constant": "Das Moment ist stets {value}, während die Achse sich bewegt: {torque} hängt, oder das Moment ist ein anderes Signal",
  lossy: "{share} der Messwerte kamen nicht, was eine Identifikation verdirbt: gehen Frames verloren, oder ist der Sender überlastet?",
  "stamps scatter": "Die Zeitstempel streuen um {scatter}: tastet die Steuerung mit eigener Uhr ab, clock = \"cyclic\" in [robot.axis.time] setzen, oder counter_message und counter_signal, wenn sie einen Zähler sendet",
  "interval differs": "Alle {found} ms kommt ein Messwert, nicht alle {interval} ms: sample_interval_s berichtigen",
  "axis gone": "Die Konfiguration hat keine Achse {axis} mehr",
  "look busy": "Gerade werden andere Signale geprüft; noch einmal versuchen",
  "frames late": "Es kamen innerhalb von {wait_s} keine Frames aus der Überwachung",

  "window too short": "{axis}: {length_s} Lernfenster sind zu wenig: das Gedächtnis der Schätzwerte braucht mindestens {least_s} Betrieb",
  "window runs": "Ein Lernfenster von {axis} läuft: sein Ende abwarten, oder es abbrechen",
  "no window": "Es läuft kein Lernfenster von {axis}",
  "in force already": "Epoche {number} von {axis} ist gültig",
  "never in force": "Epoche {number} von {axis} war nie gültig: {why}",
  "alarms first": "{axis}: Alarme sind noch nicht gespeichert; danach noch einmal versuchen",
  "worker silent": "Die Überwachung antwortet nicht: der Dienst startet oder endet; noch einmal versuchen",
  cancelled: "wurde abgebrochen",
  "axis reconfigured": "die Konfiguration der Achse wurde geändert",
  "window unobserved": "kein Parameter war lange genug zu beobachten",
  "window unexplained": "das Modell erklärte in den meisten Teilen des Fensters die Messwerte nicht",
  "window unsteady": "die Schätzwerte blieben nicht gleich",
  "window moved": "ein Parameter ist zu weit vom früheren Nennwert entfernt",
  "kept unobserved": "im Fenster nicht lange genug zu beobachten",
  "kept uncertain": "im Fenster zu unsicher",
  "kept by definition": "der Nennwert ist keine Eigenschaft von Getriebe oder Motor",
  "of parameters": "{why}: {names}",

  proposal: "{reason} → {change}",
  "samples apart": "Die Messwerte liegen {found} s auseinander, nicht {configured} s",
  bunches: "Frames kommen in Bündeln an: ihre Empfangszeit ist nicht die der Messwerte; besser wird die Uhr der Steuerung angepasst",
  scatter: "Mit gleichmäßigen Zeiten ist die Bewegung glatter als mit den Empfangszeiten: die Uhr der Steuerung wird angepasst",
  "torque too late": "das Moment kommt {samples} Werte oder mehr später als die Bewegung, die es bewirkt hat, und höchstens {most}"
    + " lassen sich berichtigen: dort verschieben, wo es aufgenommen wird, oder ohne das Filter aufnehmen",
  "late torque": "das Moment kommt {seconds} s später als die Bewegung, die es bewirkt hat, wie ein gefilterter Strom",
  "wrong sign": "Moment und Bewegung haben entgegengesetzte Vorzeichen (oder das der Bewegung ändern)",
  wraps: "Der Winkel beginnt nach {period} von vorn",
  "unit of turn": "Ein Winkel, der nach {period} von vorn beginnt, ist {unit}",
  "unit in name": "Laut Busbeschreibung hat {quantity} eine andere Einheit: {text}",
  "weight repeats": "Das Moment des Gewichts wiederholt sich nach dem {low}- bis {high}-fachen der konfigurierten Umdrehung des Arms",
  "gear by weight": "{shows}: das Getriebe hat etwa 1/{gear}; siehe sein Datenblatt",
  "is so": "{shows}: {what}",
  "in unit": "{quantity} ist {unit}",
  "whole numbers": "{shows}, und {quantity} ist ganzzahlig",
  counts: "{shows}: Inkremente, etwa {counts} je Umdrehung des Motors, also wohl 2^{power} = {likely}; siehe Datenblatt des Gebers",
  "shows inertia": "Als eine Masse zeigt der Antrieb die Trägheit {inertia} kg m², das {times}-fache des Nennwerts",
  "then times": "{shows}: {what}; dann ist es das {times}-fache",
  probably: "{shows}. Wahrscheinlich: {what}; dann ist es das {times}-fache",
  "no factor": "{quantity} braucht keinen Faktor",
  "per mille": "{shows}: wohl Promille eines Nennmoments von etwa {rated} N m (nach der Nennträgheit; siehe Typenschild)",
  "r turned": "Mit r = {r} drehte sich der Arm schneller als der Motor: r ist Armwinkel durch Motorwinkel, also der Kehrwert",
  "gear by inertia": "{shows}: mit den Nennträgheiten von Motor und Arm ist das ein Getriebe von 1/{gear}; siehe sein Datenblatt",
  "too fast": "Der Motor drehte sich mit {speed} Umdrehungen je Minute, was keiner tut: der Winkel ist wohl in Grad",
  "values beyond": "{lost} Werte liegen jenseits von {torque} N m oder {motion}, was kein Motor erreicht: torque.factor und {key}.factor setzen, bei Inkrementen 2 pi / Inkremente je Umdrehung des Motors (Datenblatt des Gebers)",
  place: "{signal} ({quantity})",
  "signal constant": "{name} ist stets {value}: die Achse stand, oder das Signal hängt; sie bewegen, und prüfen, ob es ihr Signal ist",
  "times restart": "Die Zeiten von {record} beginnen von neuem, {lost} von {rows} Zeilen liegen vor denen darüber: die Datei dort teilen oder, wenn keine Zeile fehlt, time.column aus der Konfiguration nehmen",
  "signal stuck": "{name} hängt {seconds} s lang, während die Achse sich bewegt: Sensor oder Verbindung gestört",
  "signal held": "{name} ändert sich nur bei jedem {count}. Messwert: die Steuerung soll jeden Wert einmal senden, alle {interval} s, und sample_interval_s das sein",
  "torque counted": "Das Moment ist ganzzahlig, wie in Promille des Nennmoments (CiA 402, Objekt 6077h): torque.factor auf Nennmoment (Typenschild) / 1000 [N m] setzen; Alarme in Prozent bleiben gleich",
  "motion counted": "Ganzzahlig, wie Inkremente, ist {quantity}: {key}.factor auf 2 pi / Inkremente je Umdrehung des Motors (Datenblatt des Gebers) [rad] setzen",
  "speed beyond": "Kein Motor dreht sich mit {speed} rad/s: speed.factor auf 0.10472 setzen bei Umdrehungen je Minute, auf 0.0174533 bei Grad je Sekunde",
  "inertia off": "Als eine Masse zeigt der Antrieb das {times}-fache der Nennträgheit: Einheiten, Getriebe und [robot.axis.model.nominal] prüfen; ist {quantity} der Wert des Arms, ist {key}.factor das Getriebe, Motor durch Arm",

  "body too large": "Eine Anfrage darf höchstens {most} Byte haben",
  "no TOML": "{path} ist kein TOML: {why}",
  "key renamed": "{path}: {key} heißt jetzt {change}",
  "out of limits": "{place}: muss {sign} {limit} sein",
  "key missing": "{place}: fehlt",
  "other kind": "{place}: ist nicht von der richtigen Art",

  "no frames of alarm": "Von diesem Alarm gibt es keine Rohdaten",
  "replay busy": "Der Bericht von Alarm {id} wird erstellt; danach noch einmal versuchen",
  "replay ended": "Sein Prozess wurde beendet, vielleicht aus Mangel an Speicher oder Zeit; noch einmal versuchen",

  "not possible": "Nicht möglich („{event}“): der Alarm ist jetzt „{state}“",
};

const MEANINGS: Record<string, string> = {
  "viscous friction of the motor": "viskose Reibung des Motors",
  "Coulomb friction of the motor": "Coulomb-Reibung des Motors",
  "torque offset": "Momentenversatz",
  "torque constant, relative to the one the controller uses": "Drehmomentkonstante, bezogen auf die der Steuerung",
  "gear ratio, arm angle over motor angle": "Getriebeübersetzung, Armwinkel durch Motorwinkel",
  "inertia of motor, gear and arm, on the motor side": "Trägheit von Motor, Getriebe und Arm, auf der Motorseite",
  "torque of the weight on the arm at the angle zero, as where the arm lies flat there": "Moment des Gewichts am Arm beim Winkel null",
  "torque of the weight on the arm a quarter of a turn further": "Moment des Gewichts am Arm eine Vierteldrehung weiter",
  "delay of the torque after its sample": "Verzögerung des Moments nach seinem Messwert",
  "weight of arm and payload, relative to nominal": "Gewicht von Arm und Nutzlast, bezogen auf den Nennwert",
  "time constant of the torque disturbance": "Zeitkonstante der Momentenstörung",
};
/** Massen und Federn der Antriebe der Bibliothek. */
const PART: Record<string, string> = { inertia: "Trägheit", stiffness: "Steifigkeit", damping: "Dämpfung" };
const OF: Record<string, string> = {
  motor: "des Motors", arm: "des Arms", "gearbox, arm side": "des Getriebes, Armseite",
  "mass, arm side": "der Masse {n}, Armseite", "spring, arm side": "der Feder {n}, Armseite",
};

function meaning(text: string): string | null {
  const [, part = "", of = "", n = "", side = ""] = /^(inertia|stiffness|damping) of the (\D+?)(?: (\d))?(, arm side)?$/.exec(text) ?? [];
  const whose = OF[of + side]?.replace("{n}", n);
  return MEANINGS[text] ?? (whose ? `${PART[part]} ${whose}` : null);
}

function operated(s: number): string {
  const h = s / 3600;
  return h < 1 ? `${Math.round(s / 60)} min` : `${digits(h)} h`;
}

export const de: Texts = {
  skip: "Zum Inhalt",
  pages: { overview: "Übersicht", alarms: "Alarme", system: "System", api: "API", metrics: "Metriken", report: "Bericht der Inbetriebnahme" },
  otherLanguage: "English",
  theDaemon: "Zustand des Dienstes",
  connecting: "verbindet",
  ready: "bereit",
  notReady: "nicht bereit",
  noAnswer: "keine Antwort",
  tokenNeeded: "Token nötig",
  noDataFor: (s) => `Seit ${s} keine Daten`,
  lastValues: "Die Werte unten sind von damals.",
  noAnswerYet: "Der Dienst hat noch nicht geantwortet.",
  reasons: "Warum er nicht bereit ist",
  messages: "Meldungen",
  token: "Token",
  useToken: "Verwenden",
  zone: (name) => `Zeiten in der Zeitzone dieses Browsers (${name}); die API verwendet UTC.`,
  waiting: "Wartet auf die erste Antwort.",
  notThere: (what) => `${what}: nicht vorhanden.`,
  activeAlarms: (n) => (n === 1 ? "1 aktiver Alarm" : `${n} aktive Alarme`),
  newAlarm: (axis, words) => `Neuer Alarm: ${axis}: ${words}`,
  alarmNamed: (axis, words) => `Alarm: ${axis}: ${words}`,
  more: (n) => `${n} weitere`,
  newerAlarms: "Neuere Alarme",
  olderAlarms: "Ältere Alarme",
  alarmsOf: (first, last, total) => `${first} bis ${last} von ${total}`,
  sentence,
  reach,
  course,
  meaning,
  reciprocal: (words) => `Kehrwert von: ${words}`,
  progress: (state, doneS, lengthS) =>
    lengthS === null ? null : `${state === "learning" ? "lernt" : "wird geprüft"}: ${operated(doneS ?? 0)} von ${operated(lengthS)} Betrieb`,

  sentences: SENTENCES,
  list: (names) => names.join(", ").replace(/, ([^,]*)$/, " und $1"),
  cause: CAUSES,
  who: { configuration: "Konfiguration", local: "lokal" },
  output: { speed: "Motordrehzahl", "mean speed": "mittlere Motordrehzahl", angle: "Motorwinkel" },
  reason: {
    queue_full: "Warteschlange voll", kernel_overflow: "im Kernel verloren", error_frame: "Fehlerframe", remote_frame: "Remote-Frame",
    unwanted: "nicht gebraucht", too_short: "zu kurz", undecodable: "nicht dekodierbar", signal_absent: "Signal fehlt",
    not_finite: "keine Zahl", absurd: "unmöglicher Wert", repeated: "wiederholt", out_of_order: "falsche Reihenfolge",
    untimed: "ohne Zeit", unpaired: "ohne Partner", late: "zu spät", missing: "fehlt", ambiguous: "mehrdeutiger Winkel",
    seeding: "lernt", settling: "schwingt ein", gated: "Betriebsbedingungen", outlier: "Ausreißer", starved: "zu wenig Bewegung",
    started: "erster Messwert", gap: "Lücke", not_increasing: "Zeit läuft nicht vorwärts", diverged: "divergiert",
    clock_reanchored: "Zeitlinie neu begonnen", clock_set_back: "Uhr zurückgestellt", age: "zu alt", refused: "vom Empfänger abgelehnt",
  },

  axes: "Achsen",
  noAxis: "Es ist keine Achse konfiguriert.",
  noMatch: "Keine Achse passt.",
  search: "Achse oder Parameter suchen",
  sort: "Ordnung",
  sortNeed: "nach Bedarf",
  sortName: "nach Namen",
  filter: "Zeigen",
  needs: { all: "alle", alarm: "Alarm", acknowledged: "quittiert", silent: "keine Daten", untested: "nicht geprüft", service: "außer Betrieb", normal: "normal" },
  legend: {
    tick: "Schätzwert mit 95-%-Band", zone: "Normalband (zulässige Abweichung)", scale: "Mitte: Nennwert; Enden: ± 40 %",
    dashed: "gestrichelt: zurzeit nicht geprüft", marks: "Priorität: 1 hoch, 2 mittel, 3 niedrig; nur Umriss: quittiert",
  },
  lacks: {
    worker: (since) => `der Dienst hat seit ${since} nichts gemeldet`,
    bus: (name, state) => `Bus ${name}: ${state}`,
    record: (alarms) => `noch nicht gespeicherte Alarme: ${alarms}; die Meldungen sagen warum`,
    samples: (axis, since) => (since === null ? `${axis}: noch kein Messwert` : `${axis}: seit ${since} kein Messwert`),
  },
  noSample: "noch kein Messwert",
  lastSample: (age) => `letzter Messwert vor ${age}`,
  since: "seit",
  learning: "lernt",

  status: {
    waiting: "wartet", settling: "schwingt ein", seeding: "lernt", tracking: "verfolgt", "weakly observed": "schwach beobachtet",
    "not observed": "nicht beobachtet", invalid: "ungültig", alarm: "Alarm", silent: "keine Daten",
  },
  notTested: "nicht geprüft",
  notTestedSentences: ({ parameters }, gate) => {
    const reasons = [...new Set(parameters.map((p) => p.not_tested_reason))].filter((reason) => reason !== null);
    return reasons.map((reason) => {
      const names = parameters.filter((p) => p.not_tested_reason === reason).map((p) => p.name);
      const [why, needed] = NOT_TESTED[reason];
      const condition = reason === "operating conditions" && gate ? ` (${gate})` : "";
      return `${names.join(", ")} ${names.length === 1 ? "wird" : "werden"} nicht geprüft: ${why}${condition}. Nötig: ${needed}`;
    });
  },
  notTestedReason: {
    "no sample": "kein Messwert", settling: "schwingt nach Start oder Lücke ein", "operating conditions": "Betriebsbedingungen",
    "warm-up state": "Wärmezustand unbekannt", unidentifiable: "nicht bestimmbar", seeding: "lernt",
    "not observed": "die Bewegung sagt nichts darüber", uncertain: "zu unsicher", blocked: "durch einen anderen Parameter blockiert",
    "no threshold": "keine Schwelle",
  },
  observation: { observed: "wie bei der Inbetriebnahme", "weakly observed": "weniger als bei der Inbetriebnahme", "not observed": "fast keine" },
  measured: {
    torque: "das Moment", angle: "der Winkel", speed: "die Drehzahl", "in degrees": "in Grad", "in revolutions": "in Umdrehungen",
    "in milliradians": "in Milliradiant", "in revolutions per minute": "in Umdrehungen je Minute", "in degrees per second": "in Grad je Sekunde",
    "that of the arm": "der Wert des Arms", "that of the arm, in degrees": "der Wert des Arms, in Grad",
  },
  direction: { up: "höher", down: "tiefer" },
  priority: { high: "Priorität hoch", medium: "Priorität mittel", low: "Priorität niedrig" },

  alarms: "Alarme",
  alarmFilter: {
    active: "aktiv", unacknowledged: "nicht quittiert", shelved: "zurückgestellt", stale: "lange anstehend", chattering: "flatternd",
    ended: "beendet", all: "alle", frequent: "häufigste",
  },
  firstOut: "Erstmeldung",
  firstOutMeaning: "Er wurde als erster der Alarme mehrerer Achsen seiner Gruppe ausgelöst.",
  follows: (id) => `folgt Alarm ${id}`,
  frequency: { alarms: "Alarme", axis: "Achse", parameter: "Parameter", floods: "Anteil der zehn Minuten mit mehr als zehn" },
  sound: { on: "Ton: an", off: "Ton: aus" },
  service: {
    title: "Betrieb", out: "Außer Betrieb", remove: "Außer Betrieb nehmen", giveBack: "Wieder in Betrieb nehmen",
    meaning: "Ihre Alarme werden gespeichert, aber nicht gemeldet.", after: "Ihre Alarme werden wieder gemeldet; aktive werden gezeigt.",
  },
  noAlarm: "Es wurde kein Alarm ausgelöst.",
  noAlarmHere: "Kein Alarm in dieser Liste.",
  columns: {
    state: "Zustand", axis: "Achse", parameter: "Parameter", size: "Größe", onset: "Beginn", raised: "Ausgelöst", ended: "Beendet", action: "Aktion",
  },
  active: "aktiv",
  endedPill: "beendet",
  alarmState: {
    normal: "vorbei", unacknowledged: "nicht quittiert", acknowledged: "quittiert", returned: "weg, nicht quittiert",
    latched: "gehalten", shelved: "zurückgestellt", suppressed: "unterdrückt", "out-of-service": "außer Betrieb",
  },
  until: (when) => `bis ${when}`,
  notRecorded: "noch nicht gespeichert",
  workOrder: (order) => `Auftrag ${order}`,
  frames: "Rohdaten",
  notNamed: "noch nicht benannt",
  atFirst: (names) => `zuerst ${names}`,
  notKnown: "nicht bekannt",
  unknown: "unbekannt",
  onsetRange: (low, high) => `von ${low} bis ${high} mit einer Wahrscheinlichkeit von 90 %`,
  actions: {
    acknowledge: "Quittieren", shelve: "Zurückstellen", unshelve: "Wieder zeigen", comment: "Kommentieren", cancel: "Abbrechen",
    ofAlarm: (action, id) => `${action}: Alarm ${id}`,
  },
  hideFor: "Ausblenden für",
  durations: [[3600, "1 Stunde"], [28800, "8 Stunden"], [86400, "1 Tag"], [259200, "3 Tage"], [604800, "7 Tage"]],
  comment: "Kommentar",
  workOrderLabel: "Auftragsnummer",
  giveEither: "Kommentar, Auftragsnummer oder beides angeben.",

  alarmTitle: (id) => `Alarm ${id}`,
  print: "Drucken",
  printed: (when) => `Gedruckt ${when}`,
  found: "Befund",
  howSure: "Wie sicher",
  whatToDo: "Was zu tun ist",
  history: "Verlauf",
  files: "Dateien",
  replay: { make: "Wiederholungsbericht erstellen", running: "Der Wiederholungsbericht wird erstellt.", made: "Wiederholungsbericht" },
  kind: { "": "nicht bekannt", step: "plötzlich", drift: "allmählich", forecast: "Vorhersage" },
  kindLabel: "Verlauf der Änderung",
  nominal: "Nennwert",
  causes: "Mögliche Ursachen",
  probability: "Wahrscheinlichkeit",
  alike: (names) => `sähe gleich aus: ${names}`,
  stageChanged: "Etwas hat sich geändert; die Ursache ist noch nicht bekannt. Sie wird benannt, sobald genug Bewegung gesehen wurde.",
  doubt: {
    several: "Kein einzelner Parameter erklärt es.",
    model: "Das Modell gilt nicht mehr, wie bei einem Sensorfehler.",
    sign: "Moment oder Bewegung scheint das Vorzeichen gewechselt zu haben.",
    still: "Auf das Moment folgt keine Bewegung.",
  },
  inside: "Unter den Bedingungen der Kalibrieraufnahmen ausgelöst.",
  outside: "Außerhalb der Bedingungen der Kalibrieraufnahmen ausgelöst: Fehlalarme können dort häufiger sein.",
  crossings: "Schwelle überschritten",
  times: (n) => (n === 1 ? "einmal" : `${n}-mal`),
  advice: {
    acknowledge: "Quittieren, damit andere wissen, dass sich jemand kümmert.",
    wait: "Warten, bis die Ursache benannt ist; die Achse wie üblich weiterbewegen.",
    sensor: "Zuerst Sensor, Kabel und Einstellungen der Steuerung prüfen, dann die Mechanik.",
    inspect: (what) => `Die Achse auf diese Ursache prüfen: ${what}.`,
    inspectAlike: (names) => `Die Daten können dies nicht unterscheiden, also auch prüfen: ${names}.`,
    cold: "Ein kälteres oder wärmeres Getriebe oder anderes Fett sähe gleich aus: mit seiner Temperatur vergleichen, und mit anderen Achsen.",
    payload: "Was der Roboter trägt, mit der in der Steuerung eingestellten Nutzlast vergleichen.",
    forecast: "Die Wartung vor dem Erreichen der Grenze einplanen.",
    order: "Auftragsnummer eintragen; Rohdaten und Bericht mitgeben.",
    gone: "Die Ursache ist weg. Den Verlauf davor und danach vergleichen.",
  },
  transitions: { when: "Wann", what: "Ereignis", who: "Wer", note: "Kommentar" },
  event: {
    raise: "ausgelöst", clear: "Ursache weg", latch: "Ursache weg, gehalten", acknowledge: "quittiert", shelve: "zurückgestellt",
    unshelve: "wieder gezeigt", "shelf ended": "Zurückstellung abgelaufen", suppress: "unterdrückt", unsuppress: "nicht mehr unterdrückt",
    "remove from service": "außer Betrieb", "return to service": "wieder in Betrieb", comment: "Kommentar", name: "benannt",
  },

  range: "Zeitbereich",
  presets: [[600, "10 min"], [3600, "1 h"], [28800, "8 h"], [86400, "1 d"], [604800, "7 d"], [2592000, "30 d"], [31536000, "1 Jahr"]],
  earlier: "Früher",
  later: "Später",
  closer: "Vergrößern",
  wider: "Verkleinern",
  live: "live",
  toLive: "Zum Ende",
  plotHelp: "Ziehen vergrößert; Pfeiltasten verschieben, + und − ändern den Bereich, Pos1 springt ans Ende.",
  noHistory: "Kein Verlauf in dieser Zeit.",
  legendEstimate: "Schätzwert, 95-%-Band",
  legendNominal: "Nennwert",
  legendUp: "Test höher ▲",
  legendDown: "Test tiefer ▼",
  legendThreshold: "Schwelle",
  legendAlarm: "Alarm, von Beginn bis Ende",
  plotOf: (name) => `${name}: Schätzwert mit 95-%-Band und Nennwert über der Zeit`,
  plotOfTest: (name) => `${name}: Teststatistik bezogen auf ihre Schwelle über der Zeit`,
  estimate: "Schätzwert (90 %)",
  deviation: "Abweichung",
  tolerance: "Zulässig",
  test: "Teststatistik",
  ofThreshold: (share) => `${share} der Schwelle`,
  testInShadow: "zum Vergleich: die Alarme kommen vom Multimodell-Detektor",
  excitation: "Anregung",
  testedFor: (s) => `mit diesen Nennwerten ${s} lang geprüft`,
  state: "Zustand",
  detectors: "Detektoren",
  detector: { cusum: "CUSUM-Tests", multimodel: "Multimodell-Detektor" },
  alarming: "löst die Alarme aus",
  shadow: "läuft nur mit",
  nearest: (cause, share) => `der Schwelle am nächsten: ${cause}, ${share}`,
  paused: (why) => `Schätzung pausiert: ${why}`,
  outsideCalibration: (what) => `außerhalb der Kalibrierung: ${what}`,
  heat: (w) => `Wärme der Achse: ${w}`,
  model: "Modell",
  axisAlarms: "Alarme dieser Achse",
  trend: "Langzeittrend",
  trendPlot: (name) => `${name}: Mittelwerte der Langzeitgeschichte, Trend und Vorhersageband`,
  trendLegend: "Mittelwerte; gestrichelt: Trend mit Band von ± 2 Standardabweichungen; Balken: Grenze, wann sie erreicht wird (90 %)",
  noTrend: "Noch zu wenig Geschichte für einen Trend.",

  drive: {
    title: "Antrieb",
    legend: "Vom Motor nach außen. Umrahmt: überwacht, mit der Abweichung vom Nennwert; ein Alarm hat das Zeichen seiner Priorität.",
    branch: (from) => `Abzweig bei ${from}:`,
    outside: "Überwacht, aber kein Teil der Zeichnung:",
    kind: {
      inertia: "Trägheit", spring: "Feder", damper: "Dämpfer", "spring-damper": "Feder und Dämpfer", "ideal-gear": "Getriebe",
      "viscous-friction": "viskose Reibung", "coulomb-friction": "Coulomb-Reibung", gravity: "Gewicht", "torque-offset": "Momentenversatz",
      torque: "Motormoment", "speed-sensor": "Drehzahlgeber", "angle-sensor": "Winkelgeber", gain: "Faktor des Moments",
    },
  },
  signals: {
    title: "Signale der letzten Sekunden",
    waiting: "Ab jetzt bewahrt der Dienst die Messwerte auf; die ersten kommen in einer Sekunde.",
    torque: "Motormoment [N m]",
    motion: (unit) => `Gemessene und vorhergesagte Bewegung [${unit}]`,
    error: (unit) => `Vorhersagefehler [${unit}]`,
    measured: "gemessen; Fehler",
    predicted: "vorhergesagt vom überwachten Modell",
    limit: (x) => `Grenze für Ausreißer (${x})`,
    passed: "aus diesem Messwert nichts gelernt",
  },
  bode: {
    title: "Bode-Diagramm: Nenn- und heutiges Modell",
    magnitude: (unit) => `Betrag [dB, von ${unit}]`,
    phase: "Phase [°]",
    nominal: "Nennmodell, seine Resonanzen",
    present: "heutiges Modell mit 95-%-Band, verschobene Resonanzen",
    none: "Mit den heutigen Schätzwerten ergibt der Antrieb keinen Sinn: es gibt kein heutiges Modell.",
    without: (names) => `Kein gültiger Schätzwert von ${names}: das heutige Modell hat den Nennwert.`,
    change: (db, hz) => `Größte Änderung des Betrags: ${db} bei ${hz}`,
    moved: (was, now, share) => `Resonanz: ${was} → ${now} (${share})`,
    still: "Keine Resonanz hat sich um mehr als 1 % verschoben.",
  },

  epochs: {
    title: "Epochen der Nennwerte",
    columns: { number: "Epoche", state: "Zustand", source: "Aus", since: "Gültig seit", who: "Wer", values: "Werte" },
    state: { learning: "lernt", verifying: "wird geprüft", current: "gültig", closed: "ersetzt", rolled_back: "zurückgenommen", cancelled: "abgebrochen" },
    source: { configuration: "Konfiguration", files: "Dateien", window: "Lernfenster", restored: "frühere Epoche" },
    before: "vorher:",
    baseline: "Neu einlernen",
    cancel: "Einlernen abbrechen",
    restore: "Wiederherstellen",
    hours: "Einlernen für [h Betrieb]",
    verify: "Danach prüfen für [h Betrieb]",
    meaning: {
      baseline: "Die Achse lernt ihre jetzigen Werte als neue Nennwerte. Was jetzt an ihr falsch ist, gilt dann als normal und löst keinen Alarm aus. Nur nach einer Reparatur.",
      cancel: "Die gültigen Werte bleiben.",
      restore: "Die Nennwerte dieser Epoche werden als neue Epoche wieder gültig.",
    },
    from: "Werte aus",
    fromFiles: "Die Werte dieser Dateien, aus einer neuen Inbetriebnahme, gelten sofort, wenn sie zur Achse passen.",
    thresholds: "thresholds.toml (kann fehlen)",
    confirm: {
      baseline: "Die Achse wurde repariert oder geändert und geprüft: Sie ist in Ordnung.",
      restore: "Diese Werte passen zur jetzigen Mechanik der Achse.",
    },
  },

  system: "System",
  version: "Version",
  running: "Läuft seit",
  started: "Gestartet",
  checkpoint: "Letzte Sicherung",
  none: "keine",
  buses: "Busse",
  bus: "Bus",
  up: "in Betrieb",
  reader: "Leser",
  readerKind: { "socketcan in blocks": "SocketCAN, in Blöcken", "udp_multicast in blocks": "UDP-Multicast, in Blöcken" },
  received: "Frames",
  rate: "Frames/s",
  dropped: "Verworfen",
  dropsAxis: "Messwerte je Achse",
  samples: "Messwerte",
  used: "Verwendet",
  notUsed: "Nicht verwendet",
  clocks: "Uhren",
  clock: "Uhr",
  clockKind: { receipt: "Empfangszeit", cyclic: "angepasster Zyklus", counter: "Zähler der Steuerung" },
  scatter: "Streuung",
  interval: "Intervall",
  restarts: "Neustarts",
  links: { title: "Anlagenverbindungen", link: "Verbindung", connected: "verbunden", problem: "nicht verbunden", why: "Warum nicht", pending: "Wartend", delivered: "Zugestellt", givenUp: "Aufgegeben" },
  recordings: "Aufgezeichnete Rohdaten",
  noRecording: "Keine Aufzeichnung.",
  recordNow: "Die letzten Minuten aufzeichnen",
  file: "Datei",
  fileSize: "Größe",
  load: "Belastung durch Alarme",
  perTenMinutes: "Alarme in zehn Minuten, Mittel aus sieben Tagen",
  worstTenMinutes: "In den schlimmsten zehn Minuten",
  raisedWeek: "In sieben Tagen ausgelöst",
  answerTime: "Antwortzeit des Dienstes",

  configuration: {
    title: "Konfiguration",
    meaning: "was gilt, soweit es gesetzt wurde; Geheimnisse fehlen, auch die Dateien, in denen sie stehen.",
  },
  audit: {
    title: "Wer was geändert hat", none: "Noch nichts.", older: "Ältere Änderungen", subject: "Von", alarmsOfAxis: "Alarme der Achse",
    event: {
      begun: "Einlernen begonnen", "taken over": "gültig", verified: "geprüft", cancelled: "abgebrochen", refused: "abgelehnt",
      replaced: "ersetzt", "rolled back": "zurückgenommen",
    },
  },
  process: {
    title: "Last der Maschine", cpu: "Prozessor", ofCore: (share, cores) => `${share} eines Kerns von ${cores}`,
    memory: "Speicher", disk: "Frei auf der Platte", versions: "Versionen",
  },
  databases: {
    title: "Dateien", written: "Zuletzt geschrieben", fine: "in Ordnung", damaged: "Beschädigte Dateien, die beiseitegelegt wurden:",
    holds: {
      "alarms.sqlite": "Alarme, Epochen, wer was geändert hat", "checkpoints.sqlite": "Zustand der Überwachung",
      "history.sqlite": "Geschichte der Schätzwerte", "links.sqlite": "wie weit die Anlagenverbindungen sind",
    },
  },
  commissioning: {
    title: "Inbetriebnahme", complete: "Alle Schritte sind getan: Jede Achse hat eigene Nennwerte und Schwellen.",
    next: {
      configure: "Als Nächstes:", signals: "Achsen ohne Messwerte: Was ankommt, zeigt", record: "Als Nächstes:",
      identify: "Achsen ohne eigene Nennwerte: aufzeichnen und identifizieren mit",
      calibrate: "Achsen ohne eigene Schwellen: kalibrieren mit", run: "Als Nächstes:",
    },
    signals: "Signale jetzt", check: "Alle Achsen prüfen", again: "Nochmals prüfen", stop: "Anhalten", checking: "Prüft",
    meaning: "Die letzten zehn Sekunden jeder Achse, so geprüft wie bei der Inbetriebnahme. Die Achse sollte sich bewegen.",
    rate: "Messwerte/s", missing: "Fehlen", torque: "Moment", motionRange: "Bewegung", findings: "Befund",
    fine: "wie erwartet", stands: "sie bewegt sich nicht", problem: "Problem", proposal: "Änderung", doubt: "offen",
    steps: "Schritte", folder: "Befehle für ein Terminal, im Ordner", ofConfiguration: "der Konfiguration", step: "Schritt", command: "Befehl",
    name: {
      configure: "Konfigurieren", signals: "Signale ansehen", record: "Aufzeichnen", identify: "Identifizieren", calibrate: "Kalibrieren",
      run: "Betreiben",
    },
    axes: (n, of) => `${n} von ${of} Achsen`,
    records: (n) => (n === 1 ? "1 Aufzeichnung hier" : `${n} Aufzeichnungen hier`),
    results: "Ergebnisse", nominal: "Nennwerte", thresholds: "Schwellen", motion: "Geplante Bewegung",
    done: "eigene", open: "noch nicht", report: "Bericht",
  },

  schemaLoading: "Lädt /openapi.json.",
};
