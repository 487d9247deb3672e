/** Labels and retractions that are in the log, and that a map version is awaited for. */
import type { AnchorFeature } from "../wire.ts";

export interface Awaited {
  what: "label" | "retraction";
  anchor: string;
  image: string;
  /** The newest version when it was submitted. */
  since: number;
}

export function anchorId({ anchor, image }: { anchor: string; image: string }): string {
  return image ? `${anchor}@${image}` : anchor;
}

export interface Arrived {
  awaited: Awaited;
  /** What became of the anchor; null where it was retracted. */
  anchor: AnchorFeature | null;
}

/** What a version answers of what is awaited, and what goes on being awaited. */
export function settled(
  awaited: readonly Awaited[],
  version: number,
  anchors: readonly AnchorFeature[],
): { arrived: Arrived[]; waiting: Awaited[] } {
  const arrived: Arrived[] = [];
  const waiting: Awaited[] = [];
  for (const one of awaited) {
    const anchor = anchors.find((each) => each.id === anchorId(one) && each.geometry !== null) ?? null;
    const done = version > one.since && (one.what === "label") === (anchor !== null);
    if (done) arrived.push({ awaited: one, anchor });
    else waiting.push(one);
  }
  return { arrived, waiting };
}
