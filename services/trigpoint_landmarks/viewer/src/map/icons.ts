/** Symbols drawn here, in the colours of the page: no sprite is fetched. */
import type { Map as MapLibre } from "maplibre-gl";
import type { Palette } from "./palette.ts";

const SIZE = 18; // pixels of the page
const RATIO = 2;

type Draw = (context: CanvasRenderingContext2D) => void;

function drawn(draw: Draw): ImageData {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIZE * RATIO;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("this browser draws nothing on a canvas");
  context.scale(RATIO, RATIO);
  context.translate(SIZE / 2, SIZE / 2);
  context.lineJoin = context.lineCap = "round";
  draw(context);
  return context.getImageData(0, 0, canvas.width, canvas.height);
}

function outlined(
  context: CanvasRenderingContext2D,
  path: Path2D,
  colour: string,
  around: string,
  width: number,
): void {
  context.strokeStyle = around;
  context.lineWidth = width + 2.5;
  context.stroke(path);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke(path);
}

function diamond(colours: Palette, solid: boolean): Draw {
  return (context) => {
    const path = new Path2D("M0 -6 L6 0 L0 6 L-6 0 Z");
    outlined(context, path, colours.anchor, colours.halo, 2);
    context.fillStyle = solid ? colours.anchor : colours.ground;
    context.fill(path);
  };
}

function cross(colours: Palette): Draw {
  return (context) => outlined(context, new Path2D("M-4 -4 L4 4 M4 -4 L-4 4"), colours.rejected, colours.halo, 2);
}

/** The symbols put into the map, or drawn again in other colours. */
export function drawIcons(map: MapLibre, colours: Palette): void {
  const icons = {
    "anchor-tied": diamond(colours, true),
    "anchor-loose": diamond(colours, false),
    rejected: cross(colours),
  };
  for (const [name, draw] of Object.entries(icons)) {
    if (map.hasImage(name)) map.updateImage(name, drawn(draw));
    else map.addImage(name, drawn(draw), { pixelRatio: RATIO });
  }
}
