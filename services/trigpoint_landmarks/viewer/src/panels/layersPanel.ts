/** The legend, in which every entry can be switched on and off. */
import licence from "../../node_modules/maplibre-gl/LICENSE.txt?url";
import { said } from "../api.ts";
import { el, fill } from "../dom.ts";
import { LAYER_GROUPS, type LayerGroup, type Swatch } from "../map/layerGroups.ts";
import { SHIFT_LIMITS_M } from "../map/style.ts";
import type { Store } from "../state.ts";
import type { Raster, RegisteredImage } from "../wire.ts";
import { arrowChoice, factorChoice } from "./factorChoice.ts";

const SVG = "http://www.w3.org/2000/svg";
const SHAPES: Record<Swatch, [string, Record<string, string>]> = {
  dot: ["circle", { cx: "12", cy: "8", r: "4.5", class: "solid" }],
  ellipse: ["ellipse", { cx: "12", cy: "8", rx: "9", ry: "5", class: "faint" }],
  diamond: ["path", { d: "M12 2 18 8 12 14 6 8Z", class: "solid" }],
  arrow: ["path", { d: "M3 12 20 5M14 4l6 1-3 5" }],
  line: ["path", { d: "M2 12C8 12 14 4 22 4" }],
  dashes: ["path", { d: "M2 12C8 12 14 4 22 4", "stroke-dasharray": "5 3" }],
  dots: ["path", { d: "M2 12C8 12 14 4 22 4", "stroke-dasharray": "0.5 4" }],
  cross: ["path", { d: "M8 4l8 8M16 4l-8 8" }],
  box: ["rect", { x: "3", y: "3", width: "18", height: "10", class: "faint", "stroke-dasharray": "4 2" }],
  ring: ["circle", { cx: "12", cy: "8", r: "6", class: "faint" }],
};

export function swatch(shape: Swatch, colour: string): SVGElement {
  const [name, attributes] = SHAPES[shape];
  const drawing = document.createElementNS(SVG, "svg");
  const part = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, value);
  drawing.setAttribute("viewBox", "0 0 24 16");
  drawing.setAttribute("aria-hidden", "true");
  drawing.classList.add("swatch", `of-${colour}`);
  drawing.append(part);
  return drawing;
}

interface Entry {
  id: string;
  title: string;
  hint: string;
  shown: boolean;
}

/** Shows something or hides it; what is to be said of it, if anything. */
type Show = (shown: boolean) => Promise<string>;

/** Whose work draws the map, with its licence, which has to come along. */
function credit(): HTMLElement {
  const link = el("a", { href: licence, target: "_blank", rel: "noopener" }, "MapLibre GL JS");
  return el("p", { class: "credit" }, "Drawn with ", link, ".");
}

/** What the colours of shifts mean. */
function shiftColours(): HTMLElement {
  const [small, large] = SHIFT_LIMITS_M;
  const named = [
    ["good", `to ${small} m`],
    ["fair", `to ${large} m`],
    ["bad", "more"],
    ["muted", "refused"],
  ] as const;
  return el("p", { class: "kinds" }, ...named.map(([colour, text]) => el("span", {}, swatch("dot", colour), text)));
}

export class LayersPanel {
  readonly element: HTMLElement;
  private readonly boxes = new Map<string, HTMLInputElement>();
  private readonly rasters = el("div", {});
  private readonly shifts = el("div", {});

  constructor(
    store: Store,
    private readonly show: (group: string, shown: boolean) => Promise<string>,
  ) {
    const rows = LAYER_GROUPS.map((group) =>
      this.row(group, swatch(group.swatch, group.colour), this.below(group, store)),
    );
    this.element = el("div", { class: "layers" }, el("h2", {}, "Layers"), this.rasters, ...rows, this.shifts, credit());
  }

  /** Shows or hides a group, and says so in its box. */
  switch(id: string, shown: boolean): void {
    const box = this.boxes.get(id);
    if (box && box.checked !== shown) {
      box.checked = shown;
      box.dispatchEvent(new Event("change"));
    }
  }

  offerRasters(rasters: readonly Raster[]): void {
    fill(
      this.rasters,
      ...rasters.map((raster) => {
        const entry = { id: raster.name, title: raster.title, hint: raster.attribution, shown: true };
        return this.row(entry, swatch("box", "other"), null);
      }),
    );
  }

  /** A row for each image whose shift against the ortho layer was measured, none shown yet. */
  offerShifts(images: readonly RegisteredImage[], show: (image: string, shown: boolean) => Promise<string>): void {
    const rows = images.map(({ image }, index) => {
      const hint = "from where the ortho layer has the ground to where the image shows it";
      const entry = { id: `shift-${index}`, title: `Shift of ${image}`, hint, shown: false };
      return this.row(entry, swatch("arrow", "fair"), null, (shown) => show(image, shown));
    });
    fill(this.shifts, ...rows, images.length ? shiftColours() : null);
  }

  private row(
    entry: Entry,
    mark: SVGElement,
    below: HTMLElement | null,
    show: Show = (shown) => this.show(entry.id, shown),
  ): HTMLElement {
    const id = `layer-${entry.id}`;
    const names = { "aria-labelledby": `${id}-title`, "aria-describedby": entry.hint ? `${id}-hint` : null };
    const box = el("input", { type: "checkbox", id, ...names });
    box.checked = entry.shown;
    const state = el("small", { role: "status" });
    box.addEventListener("change", async () => {
      state.className = "";
      state.textContent = box.checked ? "loading…" : "";
      try {
        state.textContent = await show(box.checked);
      } catch (error) {
        state.className = "trouble";
        state.textContent = `not there: ${said(error)}`;
      }
    });
    this.boxes.set(entry.id, box);
    const hint = entry.hint ? el("small", { id: `${id}-hint` }, entry.hint) : null;
    const text = el("span", { class: "layer-text" }, el("span", { id: `${id}-title` }, entry.title), hint, state);
    const label = el("label", { class: "layer", for: box.id }, mark, text, box);
    return el("div", {}, label, below);
  }

  private below(group: LayerGroup, store: Store): HTMLElement | null {
    if (group.id === "landmarks") {
      const kinds = ["pole", "corner", "other"];
      return el("p", { class: "kinds" }, ...kinds.map((kind) => el("span", {}, swatch("dot", kind), kind)));
    }
    if (group.id === "ellipses") {
      const choose = (ellipseFactor: number) => store.set({ ellipseFactor });
      return factorChoice("Ellipses drawn", [1, 5, 20, 100], store.state.ellipseFactor, choose);
    }
    if (group.id === "residuals") {
      return arrowChoice(store);
    }
    return null;
  }
}
