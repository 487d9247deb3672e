/** A label before it is submitted: its values, whether they can be, and what it will be called. */
import { distanceM, moved } from "../geo.ts";
import type { AerialImage, LonLat, NewLabel } from "../wire.ts";

export interface Draft {
  position: LonLat | null;
  anchor: string;
  image: string;
  sigma_m: number;
  image_sigma_m: number;
  kind: string;
}

export const EMPTY_DRAFT: Draft = {
  position: null,
  anchor: "",
  image: "",
  sigma_m: 0.1,
  image_sigma_m: 0.35,
  kind: "",
};

const TEXT_LIMIT = 200;
const SIGMA_LIMITS_M = { least: 1e-4, most: 100 };

/** What keeps a draft from being submitted; "" for nothing. */
export function obstacle(draft: Draft): string {
  if (!draft.position) return "Put the label on the map first.";
  const [lon, lat] = draft.position;
  if (!(Math.abs(lat) <= 90 && Math.abs(lon) <= 180)) return "The position is not on the globe.";
  if (!draft.anchor.trim()) return "The anchor needs a name.";
  if (draft.anchor.length > TEXT_LIMIT) return `The name has ${draft.anchor.length} characters, at most ${TEXT_LIMIT}.`;
  const { least, most } = SIGMA_LIMITS_M;
  if (!(draft.sigma_m >= least && draft.sigma_m <= most)) return `Sigma is between ${least} m and ${most} m.`;
  if (!(draft.image_sigma_m >= 0 && draft.image_sigma_m <= most)) return `The image's sigma is at most ${most} m.`;
  return "";
}

/** The label of a draft that nothing keeps from being submitted. */
export function labelOf(draft: Draft): NewLabel {
  if (!draft.position) throw new Error("the draft has no position");
  const { position, ...rest } = draft;
  return { ...rest, anchor: draft.anchor.trim(), lon_deg: position[0], lat_deg: position[1] };
}

/** A name nobody has: the prefix most anchors have, with the next number. */
export function freeName(names: readonly string[]): string {
  const numbered = names.map((name) => /^(.*?)(\d+)$/.exec(name)).filter((match) => match !== null);
  const prefix = numbered.at(-1)?.[1] ?? "label-";
  const own = numbered.filter((match) => match[1] === prefix).map((match) => match[2] ?? "0");
  const width = Math.max(2, ...own.map((digits) => digits.length));
  const next = 1 + Math.max(0, ...own.map(Number));
  return prefix + String(next).padStart(width, "0");
}

function holds(ring: readonly LonLat[], [lon, lat]: LonLat): boolean {
  let inside = false;
  ring.forEach(([toLon, toLat], index) => {
    const [fromLon, fromLat] = ring.at(index - 1) as LonLat;
    const crosses = toLat > lat !== fromLat > lat;
    if (crosses && lon < fromLon + ((toLon - fromLon) * (lat - fromLat)) / (toLat - fromLat)) inside = !inside;
  });
  return inside;
}

/** The image a place was most likely labelled in: one whose footprint holds it, else the one nearest by a corner. */
export function imageAt(images: readonly AerialImage[], position: LonLat): string {
  const shown = images.map(({ image, footprint }) => ({ image, ring: (footprint?.coordinates[0] ?? []) as LonLat[] }));
  const nearest = (ring: LonLat[]) => Math.min(...ring.map((corner) => distanceM(corner, position)));
  const held = shown.find(({ ring }) => holds(ring, position));
  const found = held ?? [...shown].sort((one, other) => nearest(one.ring) - nearest(other.ring))[0];
  return found?.image ?? "";
}

const STEPS: Record<string, [number, number]> = {
  ArrowRight: [1, 0],
  ArrowLeft: [-1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};
const STEP_M = 0.1;

export interface Keys {
  key: string;
  shiftKey: boolean;
  altKey: boolean;
}

/** Where a key moves a position: arrows by 0.1 m, with Shift by 1 m, with Alt by 1 cm; null for any other key. */
export function nudged(position: LonLat, { key, shiftKey, altKey }: Keys): LonLat | null {
  const step = STEPS[key];
  if (!step) return null;
  const lengthM = STEP_M * (shiftKey ? 10 : 1) * (altKey ? 0.1 : 1);
  return moved(position, step[0] * lengthM, step[1] * lengthM);
}
