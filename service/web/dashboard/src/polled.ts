// Answers of the daemon that are requested again and again. The last answer stays until there is another one.
import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { ask } from "./ask";
import { useLive } from "./live";
import { failure } from "./sentences";

const EVERY_MS = 10_000;
const BEAT_MS = 5000;

/** An answer, the reason why there is none, and a function that requests it at once. */
type Answer<T> = [T | null, string, () => Promise<void>];

function useAnswer<T>(path: string): Answer<T> {
  const [found, set] = useState<T | null>(null);
  const [problem, setProblem] = useState("");
  const wanted = useRef(path);
  wanted.current = path;
  const load = useCallback(async () => {
    try {
      const answer = await ask<T>(path);
      if (wanted.current === path) set(answer);
      setProblem("");
    } catch (error) {
      setProblem(failure(error));
    }
  }, [path]);
  return [found, problem, load];
}

/** Requested periodically, and with each change of `key`. */
export function usePolled<T>(path: string, every = EVERY_MS, key = ""): Answer<T> {
  const answer = useAnswer<T>(path);
  const [, , load] = answer;
  useEffect(() => {
    void load();
    const timer = setInterval(() => void load(), every);
    return () => clearInterval(timer);
  }, [load, key]);
  return answer;
}

/** Requested with each change of `key`, and each five seconds while the daemon answers. */
export function useFollowed<T>(path: string, key: string): Answer<T> {
  const { answered } = useLive();
  const answer = useAnswer<T>(path);
  const [, , load] = answer;
  useEffect(() => void load(), [load, key, Math.floor((answered ?? 0) / BEAT_MS)]);
  return answer;
}

/** Calls `load` at once, and again after the time that it returns [ms]; while the page is hidden it is not called. */
export function useRepeated(load: () => Promise<number>, everyMs: number): void {
  useEffect(() => {
    let dropped = false;
    let timer = 0;
    const turn = async (): Promise<void> => {
      const wait = document.hidden ? everyMs : await load();
      if (!dropped) timer = window.setTimeout(() => void turn(), wait);
    };
    void turn();
    return () => {
      dropped = true;
      clearTimeout(timer);
    };
  }, []);
}
