import type { MultiLineString, Polygon } from "geojson";
import { describe, expect, it } from "vitest";
import { distanceM, moved, SIGMAS_95 } from "../src/geo.ts";
import { fittedFactor } from "../src/map/exaggeration.ts";
import { ellipses, prospect, residualArrows, shiftArrows, suggestionRings } from "../src/map/features.ts";
import type { AnchorFeature, Association, LonLat, ShiftFeature, Suggestion } from "../src/wire.ts";

const SYDNEY: LonLat = [151.19, -33.89];
const ASSOCIATION: Association = {
  map_version: 1,
  landmark: "L1",
  reason: "",
  distance_m: 0.4,
  gate_m: 1.5,
  corrected_distance_m: null,
  landmark_position: SYDNEY,
  landmark_kind: "pole",
  runner_up: null,
  already_anchored_by: [],
  expected_variance_reduction_m2: null,
  explanation: "",
};

function uncertain(majorM: number) {
  return { id: "L", kind: "pole", position: SYDNEY, ellipse: { majorM, minorM: majorM, headingRad: 0 } };
}

function anchor(x: number | null): AnchorFeature {
  const properties = { residual_x_m: x, residual_y_m: x === null ? null : 0 } as AnchorFeature["properties"];
  return { type: "Feature", id: "a", geometry: { type: "Point", coordinates: SYDNEY }, properties };
}

describe("ellipses", () => {
  it("are drawn at 95 %, times the factor", () => {
    const [one] = ellipses([uncertain(0.5)], "", 3, 0).features.map(({ geometry }) => geometry as Polygon);
    const corner = one?.coordinates[0]?.[0] as LonLat;
    expect(distanceM(SYDNEY, corner)).toBeCloseTo(0.5 * SIGMAS_95 * 3, 3);
  });

  it("too small to be seen are left out", () => {
    expect(ellipses([uncertain(0.01), uncertain(1)], "", 1, 0.5).features).toHaveLength(1);
  });
});

describe("residual arrows", () => {
  it("go from the label against its residual, as many times as long as asked for", () => {
    const [one] = residualArrows([anchor(0.2)], "", 10).features.map(({ geometry }) => geometry as MultiLineString);
    const shaft = one?.coordinates[0] as LonLat[] | undefined;
    const [from, tip] = (shaft ?? []) as [LonLat, LonLat];
    expect(from).toEqual(SYDNEY);
    expect(tip[0]).toBeLessThan(SYDNEY[0]);
    expect(distanceM(from, tip)).toBeCloseTo(2, 3);
  });

  it("are not drawn for anchors that are tied to nothing", () => {
    expect(residualArrows([anchor(null)], "", 10).features).toEqual([]);
  });
});

describe("a label that might be", () => {
  it("shows its gate and the tie", () => {
    expect(prospect(SYDNEY, ASSOCIATION).features.map((one) => one.properties.part)).toEqual(["gate", "tie"]);
  });

  it("shows the nearest landmark that is refused as what it is", () => {
    const refused = { ...ASSOCIATION, landmark: "" };
    expect(prospect(SYDNEY, refused).features.map((one) => one.properties.part)).toEqual(["gate", "rival"]);
  });
});

function tile(shown: LonLat | null): ShiftFeature {
  const [lon, lat] = shown ?? [null, null];
  const properties = { image: "north", shown_lon_deg: lon, shown_lat_deg: lat, length_m: shown ? 0.5 : null };
  return {
    type: "Feature",
    geometry: { type: "Point", coordinates: SYDNEY },
    properties: properties as ShiftFeature["properties"],
  };
}

describe("an image's shift", () => {
  it("is an arrow to where the image shows the tile's middle, as many times as long as asked for", () => {
    const shown = moved(SYDNEY, 0.3, 0.4);
    const [, arrow] = shiftArrows([tile(shown)], 10).features.map(({ geometry }) => geometry as MultiLineString);
    const tip = arrow?.coordinates[0]?.[1] as LonLat;
    expect(distanceM(tip, moved(SYDNEY, 3, 4))).toBeLessThan(0.001);
  });

  it("that was refused is a point alone", () => {
    expect(shiftArrows([tile(null)], 10).features.map(({ geometry }) => geometry.type)).toEqual(["Point"]);
  });
});

describe("suggestions", () => {
  it("are the larger the more they bring, the best one the largest", () => {
    const one = (rank: number, gain: number) =>
      ({ rank, landmark: `L${rank}`, position: SYDNEY, variance_reduction_m2: gain }) as Suggestion;
    const radii = suggestionRings([one(1, 4), one(2, 1)]).features.map(({ properties }) => properties.radius);
    expect(radii).toEqual([25, 17]);
  });
});

describe("the arrows' factor", () => {
  it("suits the view: the longer residuals are a finger's breadth long, or less", () => {
    expect(fittedFactor([0.1, 0.2, 0.3], 0.9)).toBe(50);
    expect(fittedFactor([0.1, 0.2, 0.3], 0.1)).toBe(10);
  });

  it("is 1 where residuals are long already", () => {
    expect(fittedFactor([40], 0.1)).toBe(1);
  });
});
