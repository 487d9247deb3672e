import { describe, expect, it } from "vitest";
import { distanceM } from "../src/geo.ts";
import { anchorId, settled, underway } from "../src/labelling/awaited.ts";
import { EMPTY_DRAFT, freeName, imageAt, labelOf, nudged, obstacle } from "../src/labelling/draft.ts";
import type { AerialImage, AnchorFeature, LonLat } from "../src/wire.ts";

const SYDNEY: LonLat = [151.19, -33.89];
const DRAFT = { ...EMPTY_DRAFT, position: SYDNEY, anchor: "label-31", image: "image-1-1" };
const PLAIN = { shiftKey: false, altKey: false };

function anchor(id: string, placed = true): AnchorFeature {
  const geometry = placed ? { type: "Point" as const, coordinates: SYDNEY } : null;
  return { type: "Feature", id, geometry, properties: {} as AnchorFeature["properties"] };
}

describe("a draft", () => {
  it("without a place is not submitted", () => {
    expect(obstacle({ ...DRAFT, position: null })).toBe("Put the label on the map first.");
  });

  it("with a sigma beyond the service's limits says which those are", () => {
    expect(obstacle({ ...DRAFT, sigma_m: 0 })).toBe("Sigma is between 0.0001 m and 100 m.");
    expect(obstacle({ ...DRAFT, sigma_m: Number.NaN })).toBe("Sigma is between 0.0001 m and 100 m.");
  });

  it("that is whole becomes the label the service takes", () => {
    expect(obstacle(DRAFT)).toBe("");
    expect(labelOf(DRAFT)).toEqual({
      anchor: "label-31",
      image: "image-1-1",
      lat_deg: -33.89,
      lon_deg: 151.19,
      sigma_m: 0.1,
      image_sigma_m: 0.35,
      kind: "",
    });
  });
});

describe("a name", () => {
  it("goes on counting where the others end, as wide as they are", () => {
    expect(freeName(["label-00", "label-09", "label-07"])).toBe("label-10");
    expect(freeName(["p-008", "p-009"])).toBe("p-010");
  });

  it("is the first where there is no other", () => {
    expect(freeName([])).toBe("label-01");
    expect(freeName(["church"])).toBe("label-01");
  });
});

describe("the image of a place", () => {
  const square = (name: string, west: number): AerialImage => {
    const ring = [0, 1, 2, 3, 0].map((corner) => [west + (corner % 3 ? 1 : 0), corner > 1 ? 1 : 0]);
    const footprint = { type: "Polygon" as const, coordinates: [ring] };
    return { image: name, footprint, footprint_source: "", offset_x_m: null, offset_y_m: null } as AerialImage;
  };
  const images = [square("west", 0), square("east", 2)];

  it("is the one whose footprint holds it", () => {
    expect(imageAt(images, [2.5, 0.5])).toBe("east");
    expect(imageAt(images, [0.1, 0.9])).toBe("west");
  });

  it("is the nearest one's where none holds it, and none where there is no image", () => {
    expect(imageAt(images, [1.9, 0.5])).toBe("east");
    expect(imageAt([], [0, 0])).toBe("");
  });
});

describe("the arrow keys", () => {
  it.each([
    [{ key: "ArrowRight", ...PLAIN }, 0.1],
    [{ key: "ArrowUp", shiftKey: true, altKey: false }, 1],
    [{ key: "ArrowDown", shiftKey: false, altKey: true }, 0.01],
  ])("move a position by their step", (keys, stepM) => {
    expect(distanceM(SYDNEY, nudged(SYDNEY, keys) as LonLat)).toBeCloseTo(stepM, 4);
  });

  it("are the only ones that do", () => {
    expect(nudged(SYDNEY, { key: "Enter", ...PLAIN })).toBeNull();
  });
});

describe("what is awaited", () => {
  const label = { what: "label" as const, anchor: "a", image: "i", since: 3 };

  it("is, of what the log has, whatever the version does not have yet or has still", () => {
    const still = { ...anchor("b"), properties: { anchor: "b", image: "" } as AnchorFeature["properties"] };
    expect(underway([label], [still], 3)).toEqual([label, { what: "retraction", anchor: "b", image: "", since: 3 }]);
    expect(underway([label], [anchor("a@i")], 3)).toEqual([]);
  });

  it("arrives with the first later version that has the anchor", () => {
    expect(settled([label], 4, [anchor(anchorId(label))]).arrived).toHaveLength(1);
  });

  it("goes on being awaited by a version that was solved without it", () => {
    expect(settled([label], 4, []).waiting).toEqual([label]);
  });

  it("does not arrive with the version it was submitted to", () => {
    expect(settled([label], 3, [anchor("a@i")]).waiting).toEqual([label]);
  });

  it("as a retraction arrives with the version that no longer has the anchor, or no longer its label", () => {
    const retraction = { ...label, what: "retraction" as const };
    expect(settled([retraction], 4, [anchor("a@i")]).waiting).toEqual([retraction]);
    expect(settled([retraction], 4, [anchor("a@i", false)]).arrived).toHaveLength(1);
    expect(settled([retraction], 4, []).arrived).toHaveLength(1);
  });
});
