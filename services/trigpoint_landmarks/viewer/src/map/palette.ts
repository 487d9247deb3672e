/** The map's colours: those of the style sheet, so that legend and map are the same in light and dark. */

const NAMES = [
  "ground",
  "ink",
  "halo",
  "pole",
  "corner",
  "other",
  "anchor",
  "optimised",
  "filtered",
  "odometry",
  "rejected",
  "footprint",
  "suggestion",
  "selected",
  "good",
  "fair",
  "bad",
  "muted",
] as const;

export type Palette = Record<(typeof NAMES)[number], string>;

export function palette(): Palette {
  const style = getComputedStyle(document.documentElement);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()])) as Palette;
}
