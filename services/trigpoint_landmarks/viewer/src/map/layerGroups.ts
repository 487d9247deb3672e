/** What can be shown and hidden, in the order of the legend. */

export type Swatch = "dot" | "ellipse" | "diamond" | "arrow" | "line" | "dots" | "dashes" | "cross" | "box" | "ring";

export interface LayerGroup {
  id: string;
  title: string;
  hint: string;
  swatch: Swatch;
  /** The colour's name in the style sheet. */
  colour: string;
  layers: readonly string[];
  shown: boolean;
}

export const LAYER_GROUPS: readonly LayerGroup[] = [
  {
    id: "landmarks",
    title: "Landmarks",
    hint: "ringed: an anchor is tied to it",
    swatch: "dot",
    colour: "pole",
    layers: ["landmarks"],
    shown: true,
  },
  {
    id: "ellipses",
    title: "95 % uncertainty",
    hint: "from the covariance",
    swatch: "ellipse",
    colour: "pole",
    layers: ["ellipses-fill", "ellipses-line"],
    shown: true,
  },
  {
    id: "anchors",
    title: "Anchors",
    hint: "hollow: tied to no landmark",
    swatch: "diamond",
    colour: "anchor",
    layers: ["anchors"],
    shown: true,
  },
  {
    id: "residuals",
    title: "Anchor residuals",
    hint: "from the label to where the map has it",
    swatch: "arrow",
    colour: "anchor",
    layers: ["residuals"],
    shown: true,
  },
  {
    id: "optimised",
    title: "Optimised paths",
    hint: "",
    swatch: "line",
    colour: "optimised",
    layers: ["optimised"],
    shown: true,
  },
  {
    id: "filtered",
    title: "Filtered paths",
    hint: "as estimated on the way",
    swatch: "dashes",
    colour: "filtered",
    layers: ["filtered"],
    shown: false,
  },
  {
    id: "odometry",
    title: "Raw odometry",
    hint: "set down at its first pose; it drifts",
    swatch: "dots",
    colour: "odometry",
    layers: ["odometry"],
    shown: false,
  },
  {
    id: "fixes",
    title: "Rejected GNSS fixes",
    hint: "",
    swatch: "cross",
    colour: "rejected",
    layers: ["fixes"],
    shown: false,
  },
  {
    id: "footprints",
    title: "Aerial images",
    hint: "with their estimated offsets",
    swatch: "box",
    colour: "footprint",
    layers: ["footprints-fill", "footprints-line", "offsets", "footprints-name"],
    shown: false,
  },
  {
    id: "suggestions",
    title: "Where to label next",
    hint: "larger: it would help more",
    swatch: "ring",
    colour: "suggestion",
    layers: ["suggestions", "suggestions-rank"],
    shown: false,
  },
];
