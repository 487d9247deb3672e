/** How well this page is connected with the map, as a fold over what happens; and how it is said. */
import { moment, span, timeOfDay } from "../text.ts";

const LONG_AGO_S = 172_800; // beyond, a date says more

/** "events": told at once; "polling": asked every few seconds; "offline": nobody answers. */
export type Way = "connecting" | "events" | "polling" | "offline";

export interface Link {
  way: Way;
  /** When this way began, by this page's clock. */
  sinceMs: number;
  newest: number | null;
  solvedNs: number | null;
  /** The service's clock less this page's, in ms; null: it did not say. */
  clockAheadMs: number | null;
  databaseReached: boolean;
  why: string;
}

export type Happened =
  | {
      kind: "heard";
      way: "events" | "polling";
      newest: number | null;
      solvedNs: number | null;
      nowNs: number | null;
      databaseReached: boolean;
      atMs: number;
    }
  | { kind: "lost"; why: string; atMs: number };

export const UNLINKED: Link = {
  way: "connecting",
  sinceMs: 0,
  newest: null,
  solvedNs: null,
  clockAheadMs: null,
  databaseReached: true,
  why: "",
};

/** The link after something happened. */
export function linkAfter(link: Link, happened: Happened): Link {
  const way = happened.kind === "lost" ? "offline" : happened.way;
  const sinceMs = way === link.way ? link.sinceMs : happened.atMs;
  if (happened.kind === "lost") return { ...link, way, sinceMs, why: happened.why };
  return {
    way,
    sinceMs,
    newest: happened.newest,
    solvedNs: happened.solvedNs,
    clockAheadMs: happened.nowNs === null ? link.clockAheadMs : happened.nowNs / 1e6 - happened.atMs,
    databaseReached: happened.databaseReached,
    why: "",
  };
}

export interface Spoken {
  tone: "good" | "fair" | "bad";
  title: string;
  detail: string;
}

/** How old the newest version is, in words; nothing where that is not known. */
export function age(link: Link, nowMs: number): string {
  if (link.solvedNs === null || link.clockAheadMs === null) return "";
  const seconds = (nowMs + link.clockAheadMs - link.solvedNs / 1e6) / 1000;
  return seconds < LONG_AGO_S ? `${span(seconds)} old` : `of ${moment(link.solvedNs)}`;
}

function version(link: Link): string {
  return link.newest === null ? "no version yet" : `version ${link.newest}`;
}

/** What to tell people of the link. */
export function spoken(link: Link, nowMs: number): Spoken {
  if (link.way === "connecting") return { tone: "fair", title: "Connecting", detail: "asking the service" };
  if (link.way === "offline") {
    const detail = `${link.why}; what is shown may be out of date`;
    return { tone: "bad", title: `Offline since ${timeOfDay(link.sinceMs)}`, detail };
  }
  if (!link.databaseReached) {
    return {
      tone: "bad",
      title: "Stale",
      detail: `the map's database is away; ${version(link)} may not be the newest`,
    };
  }
  const detail = [version(link), age(link, nowMs)].filter(Boolean).join(", ");
  return link.way === "events"
    ? { tone: "good", title: "Live", detail }
    : { tone: "fair", title: "Live, by asking", detail: `${detail}; looked at every 2 s` };
}
