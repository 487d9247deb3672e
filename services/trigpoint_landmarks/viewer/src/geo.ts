/** Geometry near a place on the WGS84 ellipsoid: metres to degrees and back, ellipses, arrows. */
import type { LonLat } from "./wire.ts";

const EQUATOR_RADIUS_M = 6_378_137.0;
const ECCENTRICITY_SQUARED = 0.00669437999014;
const RADIANS = Math.PI / 180;

/** Of a 2-D normal distribution: the 95 % ellipse's axes over the 1-sigma ellipse's, sqrt(-2 ln 0.05). */
export const SIGMAS_95 = Math.sqrt(-2 * Math.log(0.05));

/** Metres along east and north. */
export type EastNorth = [number, number];

/** Metres of a degree of longitude and of latitude at a latitude. */
export function metresPerDegree(latDeg: number): EastNorth {
  const sine = Math.sin(latDeg * RADIANS);
  const bent = 1 - ECCENTRICITY_SQUARED * sine * sine;
  const meridianM = (EQUATOR_RADIUS_M * (1 - ECCENTRICITY_SQUARED)) / bent ** 1.5;
  const transverseM = EQUATOR_RADIUS_M / Math.sqrt(bent);
  return [transverseM * Math.cos(latDeg * RADIANS) * RADIANS, meridianM * RADIANS];
}

/** The place so many metres east and north of another; good to a millimetre over a hundred metres. */
export function moved(from: LonLat, eastM: number, northM: number): LonLat {
  const [lonM, latM] = metresPerDegree(from[1]);
  return [from[0] + eastM / lonM, from[1] + northM / latM];
}

/** How far a place lies east and north of another, in metres. */
export function metresBetween(from: LonLat, to: LonLat): EastNorth {
  const [lonM, latM] = metresPerDegree((from[1] + to[1]) / 2);
  return [(to[0] - from[0]) * lonM, (to[1] - from[1]) * latM];
}

/** The distance of two places that are near each other, in metres. */
export function distanceM(from: LonLat, to: LonLat): number {
  return Math.hypot(...metresBetween(from, to));
}

/**
 * How far grid north lies east of true north at a place, in radians; 0 for a grid other than UTM's on WGS84
 * (EPSG 32601 to 32660 and 32701 to 32760). To first order in the ellipsoid's flattening.
 */
export function gridConvergenceRad(crs: string, at: LonLat): number {
  const zone = /\/EPSG\/[^/]*\/32[67](\d\d)$/.exec(crs)?.[1];
  if (zone === undefined) return 0;
  const fromMeridian = (at[0] - (Number(zone) * 6 - 183)) * RADIANS;
  return Math.atan(Math.tan(fromMeridian) * Math.sin(at[1] * RADIANS));
}

/** A vector along grid east and north as one along true east and north. */
export function trueFromGrid([x, y]: EastNorth, convergenceRad: number): EastNorth {
  const cosine = Math.cos(convergenceRad);
  const sine = Math.sin(convergenceRad);
  return [x * cosine + y * sine, y * cosine - x * sine];
}

export interface Ellipse {
  majorM: number;
  minorM: number;
  /** Of the longer semi-axis, counter-clockwise from grid east. */
  headingRad: number;
}

/** The closed ring of an ellipse around a place. */
export function ellipseRing(centre: LonLat, ellipse: Ellipse, convergenceRad: number, corners = 48): LonLat[] {
  const cosine = Math.cos(ellipse.headingRad);
  const sine = Math.sin(ellipse.headingRad);
  const ring: LonLat[] = [];
  for (let index = 0; index <= corners; index += 1) {
    const angle = (2 * Math.PI * (index % corners)) / corners;
    const along = ellipse.majorM * Math.cos(angle);
    const across = ellipse.minorM * Math.sin(angle);
    const grid: EastNorth = [along * cosine - across * sine, along * sine + across * cosine];
    ring.push(moved(centre, ...trueFromGrid(grid, convergenceRad)));
  }
  return ring;
}

/** The closed ring of a circle around a place. */
export function circleRing(centre: LonLat, radiusM: number): LonLat[] {
  return ellipseRing(centre, { majorM: radiusM, minorM: radiusM, headingRad: 0 }, 0);
}

/** An arrow from a place along a vector in metres: its shaft, and its head as two barbs. */
export function arrowLines(from: LonLat, [eastM, northM]: EastNorth): LonLat[][] {
  const tip = moved(from, eastM, northM);
  const barb = (turn: number): LonLat => {
    const angle = Math.atan2(northM, eastM) + Math.PI + turn;
    const lengthM = Math.hypot(eastM, northM) * 0.28;
    return moved(tip, lengthM * Math.cos(angle), lengthM * Math.sin(angle));
  };
  return [
    [from, tip],
    [barb(0.45), tip, barb(-0.45)],
  ];
}
