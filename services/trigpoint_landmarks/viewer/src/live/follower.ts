/** Follows the map: by server-sent events, by asking where those fail, and says when nobody answers. */
import { type MapApi, said } from "../api.ts";
import type { Told } from "../wire.ts";
import { EventText } from "./eventStream.ts";
import { type Happened, type Link, linkAfter, UNLINKED } from "./link.ts";

const SILENCE_MS = 12_000; // the service says that it is there at least every 5 s
const ASK_AGAIN_MS = 2_000;

export class Follower {
  link: Link = UNLINKED;

  constructor(
    private readonly api: MapApi,
    private readonly changed: (link: Link) => void,
  ) {}

  /** Follows until the page is gone. */
  async run(): Promise<never> {
    for (;;) {
      try {
        await this.listen();
      } catch {
        await this.ask(); // it says what is wrong, if anything is
      }
      await new Promise((resolve) => setTimeout(resolve, ASK_AGAIN_MS));
    }
  }

  private happen(happened: Happened): void {
    this.link = linkAfter(this.link, happened);
    this.changed(this.link);
  }

  /** Returns when the service ends the stream; throws where there is none, or where it falls silent. */
  private async listen(): Promise<void> {
    const silence = new AbortController();
    let timer = setTimeout(() => silence.abort(), SILENCE_MS);
    try {
      const answer = await this.api.answer(this.api.url("events"), { signal: silence.signal, cache: "no-store" });
      if (!answer.body) return;
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      const text = new EventText();
      for (let part = await reader.read(); !part.done; part = await reader.read()) {
        clearTimeout(timer);
        timer = setTimeout(() => silence.abort(), SILENCE_MS);
        for (const event of text.take(part.value)) this.hear(JSON.parse(event.data) as Told);
      }
    } finally {
      clearTimeout(timer);
    }
    await this.ask();
  }

  private hear(told: Told): void {
    this.happen({
      kind: "heard",
      way: "events",
      newest: told.map_version,
      solvedNs: told.solved_ns,
      nowNs: told.now_ns,
      databaseReached: told.database_reached,
      atMs: Date.now(),
    });
  }

  private async ask(): Promise<void> {
    try {
      const { map_version: newest, solved_ns: solvedNs } = await this.api.versions();
      const heard = { way: "polling", newest, solvedNs, nowNs: null, databaseReached: true } as const;
      this.happen({ kind: "heard", ...heard, atMs: Date.now() });
    } catch (error) {
      this.happen({ kind: "lost", why: said(error), atMs: Date.now() });
    }
  }
}
