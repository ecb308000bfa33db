// A short tone for a new unacknowledged alarm. Off until the user of this browser switches it on.
import { useEffect, useRef, useState } from "preact/hooks";
import type { Alarm } from "./ask";
import { keyOf } from "./need";
import { t } from "./texts";

const KEY = "axiswatch-sound";
const TONE_HZ = 880;
const LENGTH_S = 0.5;

let audio: AudioContext | null = null;

/** Browsers allow sound only after a click into the page. */
function allow(): AudioContext {
  audio ??= new AudioContext();
  void audio.resume();
  return audio;
}

function sound(): void {
  const { currentTime, destination } = allow();
  const [tone, volume] = [new OscillatorNode(allow(), { frequency: TONE_HZ }), new GainNode(allow(), { gain: 0.25 })];
  volume.gain.exponentialRampToValueAtTime(0.001, currentTime + LENGTH_S);
  tone.connect(volume).connect(destination);
  tone.start();
  tone.stop(currentTime + LENGTH_S);
}

/** Whether one of the alarms has become unacknowledged since the keys were made; null: they are the first ones. */
export function isNew(known: Set<string> | null, active: Alarm[]): [boolean, Set<string>] {
  const keys = new Set(active.filter((alarm) => alarm.state === "unacknowledged").map((a) => `${keyOf(a)} ${a.reopened}`));
  return [known !== null && [...keys].some((key) => !known.has(key)), keys];
}

export function SoundSwitch({ active, answered }: { active: Alarm[]; answered: boolean }) {
  const [on, set] = useState(localStorage.getItem(KEY) === "on");
  const known = useRef<Set<string> | null>(null);
  useEffect(() => {
    if (!answered) return;
    const [fresh, keys] = isNew(known.current, active);
    known.current = keys;
    if (fresh && on) sound();
  }, [active, answered]);
  useEffect(() => {
    if (!on) return undefined;
    addEventListener("pointerdown", allow, { once: true });
    return () => removeEventListener("pointerdown", allow);
  }, [on]);
  const change = (): void => {
    localStorage.setItem(KEY, on ? "off" : "on");
    set(!on);
    if (!on) sound();
  };
  return <button type="button" class="plain" onClick={change}>{on ? t.sound.on : t.sound.off}</button>;
}
