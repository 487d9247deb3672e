import { describe, expect, it } from "vitest";
import { EventText } from "../src/live/eventStream.ts";
import { type Happened, linkAfter, spoken, UNLINKED } from "../src/live/link.ts";

const NOON_MS = 1_700_000_000_000;

function heard(more: Partial<Extract<Happened, { kind: "heard" }>> = {}): Happened {
  const solvedNs = (NOON_MS - 60_000) * 1e6;
  const told = { newest: 7, solvedNs, nowNs: NOON_MS * 1e6, databaseReached: true, atMs: NOON_MS };
  return { kind: "heard", way: "events", ...told, ...more };
}

describe("server-sent events", () => {
  it("that arrive in pieces are told once whole", () => {
    const text = new EventText();
    expect(text.take("event: version\nda")).toEqual([]);
    expect(text.take('ta: {"a": 1}\n\nevent: alive\n')).toEqual([{ name: "version", data: '{"a": 1}' }]);
  });

  it("leave comments out, and join lines of data", () => {
    expect(new EventText().take(": kept open\n\ndata: a\r\ndata: b\r\n\r\n")).toEqual([
      { name: "message", data: "a\nb" },
    ]);
  });
});

describe("the link", () => {
  it("is live once something was heard, and says how old the map is", () => {
    const words = spoken(linkAfter(UNLINKED, heard()), NOON_MS);
    expect(words).toEqual({ tone: "good", title: "Live", detail: "version 7, 60 s old" });
  });

  it("measures the map's age with the service's clock", () => {
    const ahead = heard({ nowNs: (NOON_MS + 30_000) * 1e6 });
    expect(spoken(linkAfter(UNLINKED, ahead), NOON_MS).detail).toContain("2 min old");
  });

  it("is offline since the first failure, not the last", () => {
    const first = linkAfter(linkAfter(UNLINKED, heard()), { kind: "lost", why: "no answer", atMs: NOON_MS + 5_000 });
    const second = linkAfter(first, { kind: "lost", why: "no answer", atMs: NOON_MS + 9_000 });
    expect(second.sinceMs).toBe(NOON_MS + 5_000);
    expect(spoken(second, NOON_MS + 9_000).title).toMatch(/^Offline since \d\d:\d\d:\d\d$/);
  });

  it("goes on naming the version it last heard of while offline", () => {
    expect(linkAfter(linkAfter(UNLINKED, heard()), { kind: "lost", why: "", atMs: NOON_MS }).newest).toBe(7);
  });

  it("is stale while the service's database is away", () => {
    const words = spoken(linkAfter(UNLINKED, heard({ databaseReached: false })), NOON_MS);
    expect([words.tone, words.title]).toEqual(["bad", "Stale"]);
  });

  it("says when it only asks", () => {
    expect(spoken(linkAfter(UNLINKED, heard({ way: "polling", nowNs: null })), NOON_MS).title).toBe("Live, by asking");
  });
});
