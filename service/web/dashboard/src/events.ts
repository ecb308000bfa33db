// Follows the server-sent events of the daemon. By fetch, as EventSource sends no token; without events it is polled.
import { authorization, type Axis } from "./ask";

const PATH = "/api/v1/events";
const SILENT_MS = 15_000; // the daemon sends a comment each ten seconds
const RETRY_MS = 5000;
const NEVER = Infinity;

export interface Takers {
  axes: (axes: Axis[], all: boolean) => void;
  alarm: () => void;
}

/** Splits a stream of text into events; an incomplete part is kept. */
export class EventParser {
  private rest = "";

  /** The events that this text completes: their names and data. */
  add(text: string): { event: string; data: string }[] {
    const blocks = (this.rest + text).replaceAll("\r\n", "\n").split("\n\n");
    this.rest = blocks.pop() ?? "";
    return blocks.map(parse).filter(({ data }) => data !== "");
  }
}

function parse(block: string): { event: string; data: string } {
  let event = "message";
  const data: string[] = [];
  for (const line of block.split("\n")) {
    const [, field, value = ""] = /^([^:]*):? ?(.*)$/.exec(line) ?? [];
    if (field === "event") event = value;
    if (field === "data") data.push(value);
  }
  return { event, data: data.join("\n") };
}

export class Follower {
  private following = false;
  private retryAt = 0;
  private running = false;

  constructor(private readonly takers: Takers) {}

  /** Whether axes are received by events now. */
  isFollowing = (): boolean => this.following;

  /** Starts to follow, unless it already does, or the daemon has no events. */
  follow(): void {
    if (this.running || Date.now() < this.retryAt) return;
    this.running = true;
    void this.read().finally(() => {
      this.running = this.following = false;
    });
  }

  private async read(): Promise<void> {
    const stop = new AbortController();
    let watchdog = setTimeout(() => stop.abort(), SILENT_MS);
    try {
      const answer = await fetch(PATH, { headers: authorization(), signal: stop.signal, cache: "no-store" });
      this.retryAt = answer.status === 404 ? NEVER : Date.now() + RETRY_MS;
      if (!answer.ok || answer.body === null) return await answer.body?.cancel();
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      const parser = new EventParser();
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return undefined;
        clearTimeout(watchdog);
        watchdog = setTimeout(() => stop.abort(), SILENT_MS);
        for (const found of parser.add(value)) this.take(found);
      }
    } catch {
      this.retryAt = Date.now() + RETRY_MS;
    } finally {
      clearTimeout(watchdog);
    }
  }

  private take({ event, data }: { event: string; data: string }): void {
    if (event === "alarm") this.takers.alarm();
    if (event !== "axes") return;
    this.takers.axes((JSON.parse(data) as { axes: Axis[] }).axes, !this.following);
    this.following = true; // the first event has all axes
  }
}
