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

/** What stands in the log and not in a version yet: labels it does not have, and anchors that are labels no more. */
export function underway(
  labels: readonly { anchor: string; image: string }[],
  anchors: readonly AnchorFeature[],
  version: number,
): Awaited[] {
  const placed = anchors.filter((one) => one.geometry !== null);
  const ids = new Set(placed.map((one) => one.id));
  const inForce = new Set(labels.map(anchorId));
  const fresh = labels.filter((label) => !ids.has(anchorId(label)));
  const gone = placed.filter((one) => !inForce.has(String(one.id))).map((one) => one.properties);
  return [
    ...fresh.map(({ anchor, image }): Awaited => ({ what: "label", anchor, image, since: version })),
    ...gone.map(({ anchor, image }): Awaited => ({ what: "retraction", anchor, image, since: version })),
  ];
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
