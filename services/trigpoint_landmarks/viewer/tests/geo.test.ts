import { describe, expect, it } from "vitest";
import {
  arrowLines,
  circleRing,
  distanceM,
  ellipseRing,
  gridConvergenceRad,
  metresBetween,
  moved,
  SIGMAS_95,
  trueFromGrid,
} from "../src/geo.ts";
import type { LonLat } from "../src/wire.ts";

const SYDNEY: LonLat = [151.19, -33.89];
const UTM_56_SOUTH = "http://www.opengis.net/def/crs/EPSG/0/32756";
const MILLIMETRE = 1e-3;

describe("places", () => {
  it("moved and measured again are where they were put, to a millimetre", () => {
    const [eastM, northM] = metresBetween(SYDNEY, moved(SYDNEY, 30, -40));
    expect(Math.abs(eastM - 30)).toBeLessThan(MILLIMETRE);
    expect(Math.abs(northM + 40)).toBeLessThan(MILLIMETRE);
  });

  it("a degree of latitude apart on the equator are 110 574 m apart", () => {
    expect(distanceM([0, -0.5], [0, 0.5])).toBeCloseTo(110_574.3, 0);
  });
});

describe("grid convergence", () => {
  it("is nothing on the zone's own meridian", () => {
    expect(gridConvergenceRad(UTM_56_SOUTH, [153, -33])).toBeCloseTo(0, 12);
  });

  it("is that of pyproj for the campus, to a thousandth of a degree", () => {
    // Proj("EPSG:32756").get_factors(151.19, -33.89).meridian_convergence
    expect((gridConvergenceRad(UTM_56_SOUTH, SYDNEY) * 180) / Math.PI).toBeCloseTo(1.009491, 3);
  });

  it("is left out for a grid that is not UTM's", () => {
    expect(gridConvergenceRad("http://www.opengis.net/def/crs/EPSG/0/2154", [3, 46])).toBe(0);
  });

  it("turns grid north to the east of true north where it is positive", () => {
    const [east, north] = trueFromGrid([0, 1], 0.01);
    expect(Math.atan2(east, north)).toBeCloseTo(0.01, 12);
  });
});

describe("ellipses", () => {
  it("of 95 % reach 2.45 sigma", () => {
    expect(SIGMAS_95).toBeCloseTo(2.4477, 4);
  });

  it("are closed", () => {
    const ring = circleRing(SYDNEY, 2);
    expect(ring[0]).toEqual(ring.at(-1));
  });

  it("reach as far as their axes along them", () => {
    const ring = ellipseRing(SYDNEY, { majorM: 3, minorM: 1, headingRad: Math.PI / 2 }, 0, 4);
    const ways = ring.slice(0, 4).map((corner) => distanceM(SYDNEY, corner));
    expect(ways.map((way) => Math.round(way * 1e3) / 1e3)).toEqual([3, 1, 3, 1]);
  });

  it("with a heading of a quarter turn lie along grid north", () => {
    const [first] = ellipseRing(SYDNEY, { majorM: 3, minorM: 1, headingRad: Math.PI / 2 }, 0, 4);
    const [eastM, northM] = metresBetween(SYDNEY, first as LonLat);
    expect(Math.abs(eastM)).toBeLessThan(MILLIMETRE);
    expect(northM).toBeCloseTo(3, 3);
  });
});

describe("arrows", () => {
  it("end in a head of two barbs at their tip", () => {
    const [shaft, head] = arrowLines(SYDNEY, [4, 3]);
    expect(distanceM(SYDNEY, shaft?.[1] as LonLat)).toBeCloseTo(5, 3);
    expect(head?.[1]).toEqual(shaft?.[1]);
  });
});
