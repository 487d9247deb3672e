import { describe, expect, it } from "vitest";
import { counted, degrees, metres, moment, percent, span } from "../src/text.ts";

describe("numbers for people", () => {
  it.each([
    [0.0042, "4.2 mm"],
    [0.123, "0.12 m"],
    [-3.456, "-3.46 m"],
    [321.7, "322 m"],
    [12_340, "12.3 km"],
    [null, "unknown"],
  ])("lengths have the digits that mean something", (value, text) => {
    expect(metres(value)).toBe(text);
  });

  it.each([
    [-2, "0 s"],
    [89, "89 s"],
    [300, "5 min"],
    [7200, "2 h"],
    [172_800, "2 days"],
  ])("spans have one unit", (seconds, text) => {
    expect(span(seconds)).toBe(text);
  });

  it("say their count", () => {
    expect([counted(1, "anchor"), counted(1234, "landmark")]).toEqual(["1 anchor", "1,234 landmarks"]);
    expect([percent(0.034), percent(0.31)]).toEqual(["3.4 %", "31 %"]);
  });

  it("name moments in UTC, and those no calendar has as they are", () => {
    expect(moment(1_709_511_362_120_000_000)).toBe("2024-03-04 00:16:02 UTC");
    expect(moment(9e25)).toBe("9e+25 ns");
  });

  it("give latitude before longitude", () => {
    expect(degrees([151.19, -33.89])).toBe("-33.8900000°, 151.1900000°");
  });
});
