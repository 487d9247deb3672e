/** The map's style: sources and layers, all from this service. */
import type { LayerSpecification, SourceSpecification, StyleSpecification } from "maplibre-gl";
import type { Raster } from "../wire.ts";
import { LAYER_GROUPS } from "./layerGroups.ts";
import type { Palette } from "./palette.ts";

/** Sources that are filled with features as they come. */
export const FEATURE_SOURCES = [
  "ellipses",
  "anchors",
  "residuals",
  "filtered",
  "odometry",
  "fixes",
  "footprints",
  "offsets",
  "shifts",
  "suggestions",
  "selected",
  "prospect",
] as const;
export type FeatureSource = (typeof FEATURE_SOURCES)[number];

export const TILE_SOURCES = ["landmarks", "trajectories"] as const;
const DEEPEST_ZOOM = 22;
/** Up to which a shift is small, and over which it is large: a pixel of aerial images, and what is seen unmeasured. */
export const SHIFT_LIMITS_M = [0.2, 0.5] as const;
const FONT = ["sans-serif"];

const WIDER = ["interpolate", ["linear"], ["zoom"], 14, 1.4, 20, 3];

const PLAIN = { "fill-antialias": false }; // a line goes around each fill

type Paint = Record<string, unknown>;

function layer(type: string, id: string, source: string, paint: Paint, more: Record<string, unknown> = {}) {
  return { type, id, source, paint, ...more } as unknown as LayerSpecification;
}

function line(id: string, source: string, colour: string, more: Paint = {}, rest: Record<string, unknown> = {}) {
  const paint = { "line-color": colour, "line-width": WIDER, ...more };
  return layer("line", id, source, paint, { layout: { "line-cap": "round", "line-join": "round" }, ...rest });
}

function ofKind(colours: Palette): unknown {
  return ["match", ["get", "kind"], "pole", colours.pole, "corner", colours.corner, colours.other];
}

function pathLayers(colours: Palette): LayerSpecification[] {
  return [
    line("odometry", "odometry", colours.odometry, { "line-dasharray": [0.2, 2] }),
    line("filtered", "filtered", colours.filtered, { "line-dasharray": [2.5, 1.8] }),
    line("optimised", "trajectories", colours.optimised, { "line-opacity": 0.85 }, { "source-layer": "trajectories" }),
  ];
}

function footprintLayers(colours: Palette): LayerSpecification[] {
  const text = { "text-field": ["get", "title"], "text-font": FONT, "text-size": 12 };
  return [
    layer("fill", "footprints-fill", "footprints", { ...PLAIN, "fill-color": colours.footprint, "fill-opacity": 0.06 }),
    line("footprints-line", "footprints", colours.footprint, { "line-width": 1.5, "line-dasharray": [4, 2] }),
    line("offsets", "offsets", colours.footprint, { "line-width": 2.5 }),
    layer(
      "symbol",
      "footprints-name",
      "footprints",
      { "text-color": colours.footprint, "text-halo-color": colours.ground, "text-halo-width": 1.5 },
      { layout: { ...text, "text-anchor": "bottom", "text-offset": [0, -1] }, minzoom: 15 },
    ),
  ];
}

function landmarkLayers(colours: Palette): LayerSpecification[] {
  const dot = {
    "circle-color": ofKind(colours),
    "circle-radius": ["interpolate", ["linear"], ["zoom"], 13, 2.5, 17, 4, 21, 5.5],
    "circle-stroke-color": ["case", ["==", ["get", "anchored"], true], colours.anchor, colours.halo],
    "circle-stroke-width": ["case", ["==", ["get", "anchored"], true], 2, 1],
  };
  return [
    layer("fill", "ellipses-fill", "ellipses", { ...PLAIN, "fill-color": ofKind(colours), "fill-opacity": 0.16 }),
    layer("line", "ellipses-line", "ellipses", {
      "line-color": ofKind(colours),
      "line-width": 1.2,
      "line-opacity": 0.75,
    }),
    layer("circle", "landmarks", "landmarks", dot, { "source-layer": "landmarks" }),
  ];
}

function anchorLayers(colours: Palette): LayerSpecification[] {
  const size = ["interpolate", ["linear"], ["zoom"], 15, 0.6, 18, 1];
  const icon = (name: unknown) => ({ layout: { "icon-image": name, "icon-allow-overlap": true, "icon-size": size } });
  return [
    line("residuals", "residuals", colours.anchor, { "line-width": 2 }),
    layer("symbol", "fixes", "fixes", {}, icon("rejected")),
    layer(
      "symbol",
      "anchors",
      "anchors",
      {},
      icon(["case", ["==", ["get", "landmark"], ""], "anchor-loose", "anchor-tied"]),
    ),
  ];
}

/** A tile's colour by its shift's length; one without was refused. */
function ofLength(colours: Palette): unknown {
  const [small, large] = SHIFT_LIMITS_M;
  const length = ["get", "length_m"];
  const told = ["case", ["<=", length, small], colours.good, ["<=", length, large], colours.fair, colours.bad];
  return ["case", ["==", length, null], colours.muted, told];
}

function shiftLayers(colours: Palette): LayerSpecification[] {
  const refused = ["==", ["get", "length_m"], null];
  const dot = {
    "circle-color": ["case", refused, colours.ground, ofLength(colours)],
    "circle-radius": 3.5,
    "circle-stroke-color": ["case", refused, colours.muted, colours.halo],
    "circle-stroke-width": ["case", refused, 2, 1],
  };
  return [
    line(
      "shift-arrows",
      "shifts",
      colours.bad,
      { "line-color": ofLength(colours), "line-width": 2 },
      ofType("LineString"),
    ),
    layer("circle", "shifts", "shifts", dot, ofType("Point")),
  ];
}

function ofType(type: string): Record<string, unknown> {
  return { filter: ["==", ["geometry-type"], type] };
}

function suggestionLayers(colours: Palette): LayerSpecification[] {
  const ring = {
    "circle-radius": ["get", "radius"],
    "circle-color": colours.suggestion,
    "circle-opacity": 0.12,
    "circle-stroke-color": colours.suggestion,
    "circle-stroke-width": 2.5,
  };
  const rank = {
    "text-field": ["to-string", ["get", "rank"]],
    "text-font": FONT,
    "text-size": 12,
    "text-offset": [0, -2.8],
    "symbol-sort-key": ["get", "rank"],
  };
  const paint = { "text-color": colours.suggestion, "text-halo-color": colours.ground, "text-halo-width": 2 };
  return [
    layer("circle", "suggestions", "suggestions", ring),
    layer("symbol", "suggestions-rank", "suggestions", paint, { layout: rank }),
  ];
}

function pointedAtLayers(colours: Palette): LayerSpecification[] {
  const part = (name: string) => ({ filter: ["==", ["get", "part"], name] });
  return [
    layer(
      "fill",
      "prospect-gate",
      "prospect",
      { ...PLAIN, "fill-color": colours.anchor, "fill-opacity": 0.08 },
      part("gate"),
    ),
    line(
      "prospect-gate-line",
      "prospect",
      colours.anchor,
      { "line-width": 1.5, "line-dasharray": [2, 2] },
      part("gate"),
    ),
    line("prospect-tie", "prospect", colours.anchor, { "line-width": 3 }, part("tie")),
    line("prospect-rival", "prospect", colours.odometry, { "line-width": 2, "line-dasharray": [1, 2] }, part("rival")),
    layer("circle", "selected", "selected", {
      "circle-radius": 11,
      "circle-opacity": 0,
      "circle-stroke-color": colours.selected,
      "circle-stroke-width": 2.5,
    }),
  ];
}

/** The layers above the rasters, from the lowest up. */
export function dataLayers(colours: Palette): LayerSpecification[] {
  return [
    ...footprintLayers(colours),
    ...pathLayers(colours),
    ...landmarkLayers(colours),
    ...shiftLayers(colours),
    ...anchorLayers(colours),
    ...suggestionLayers(colours),
    ...pointedAtLayers(colours),
  ];
}

function hidden(one: LayerSpecification): LayerSpecification {
  const group = LAYER_GROUPS.find((each) => each.layers.includes(one.id));
  if (!group || group.shown || one.type === "background") return one;
  return { ...one, layout: { ...one.layout, visibility: "none" } } as LayerSpecification;
}

/** The style of the beginning, each layer shown or hidden as its group is; `tiles`: the template of a layer's tiles. */
export function styleOf(colours: Palette, tiles: (layer: string) => string): StyleSpecification {
  const ground: LayerSpecification = {
    type: "background",
    id: "ground",
    paint: { "background-color": colours.ground },
  };
  const layers = [ground, ...dataLayers(colours).map(hidden)];
  return { version: 8, sources: Object.fromEntries(sources(tiles)), layers };
}

function sources(tiles: (layer: string) => string): [string, SourceSpecification][] {
  const tiled = TILE_SOURCES.map((name): [string, SourceSpecification] => [
    name,
    { type: "vector", tiles: [tiles(name)], maxzoom: DEEPEST_ZOOM },
  ]);
  const featured = FEATURE_SOURCES.map((name): [string, SourceSpecification] => [
    name,
    { type: "geojson", data: { type: "FeatureCollection", features: [] } },
  ]);
  return [...tiled, ...featured];
}

/** The source of a raster, and its layer, which lies under everything else. */
export function rasterSource(raster: Raster, base: string): SourceSpecification {
  return {
    type: "raster",
    tiles: raster.tiles.map((template) => base + template.replace(/^\//, "")),
    tileSize: raster.tile_size,
    bounds: raster.bounds,
    minzoom: raster.minzoom,
    maxzoom: raster.maxzoom,
    attribution: raster.attribution,
  };
}
