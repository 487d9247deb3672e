/** The map's features as a list: the same as on the canvas, without it. */
import type { Feature, Geometry } from "geojson";
import { type MapApi, said } from "../api.ts";
import { button, el, fill, options } from "../dom.ts";
import { SIGMAS_95 } from "../geo.ts";
import { shiftId } from "../map/features.ts";
import type { MapView } from "../map/mapView.ts";
import type { Selection, Store } from "../state.ts";
import { counted, metres, moment } from "../text.ts";
import type { LonLat } from "../wire.ts";

const LISTED_MOST = 200;

interface Row {
  title: string;
  about: string;
  selection: Selection;
  position: LonLat | null;
}

const CHOICES = [
  ["landmark", "Landmarks in view"],
  ["anchor", "Anchors"],
  ["fix", "Rejected fixes"],
  ["image", "Aerial images"],
  ["shift", "Shifts of images shown"],
] as const;

function placeOf(feature: Feature<Geometry | null>): LonLat | null {
  return feature.geometry?.type === "Point" ? (feature.geometry.coordinates as LonLat) : null;
}

export class ListPanel {
  readonly element: HTMLElement;
  private readonly what = el("select", { id: "list-what" });
  private readonly search = el("input", { id: "list-search", type: "search", autocomplete: "off" });
  private readonly count = el("p", { class: "muted", role: "status" });
  private readonly list = el("ul", { class: "rows" });
  private rows: readonly Row[] = [];
  private open = false;
  private asked = 0;

  constructor(
    private readonly api: MapApi,
    private readonly store: Store,
    private readonly view: MapView,
    private readonly choose: (selection: Selection, position: LonLat | null) => void,
  ) {
    options(this.what, CHOICES);
    this.what.addEventListener("change", () => void this.load());
    this.search.addEventListener("input", () => this.render());
    this.element = el(
      "div",
      {},
      el("h2", {}, "List"),
      el(
        "div",
        { class: "pair" },
        el("div", { class: "field" }, el("label", { for: "list-what" }, "Show"), this.what),
        el("div", { class: "field" }, el("label", { for: "list-search" }, "Find"), this.search),
      ),
      this.count,
      this.list,
    );
    store.on(["anchors", "fixes", "images", "shifts"], () => this.open && void this.load());
    view.map.on("moveend", () => this.open && this.what.value === "landmark" && void this.load());
  }

  /** To be called when it comes to be seen, and when it is not any more. */
  async show(open: boolean): Promise<void> {
    this.open = open;
    if (open) await this.load();
  }

  private async load(): Promise<void> {
    this.asked += 1;
    const number = this.asked;
    try {
      const rows = await this.found(this.what.value);
      if (number !== this.asked) return; // something else was asked for since
      this.rows = rows;
      this.render();
    } catch (error) {
      if (number === this.asked) this.count.textContent = said(error);
    }
  }

  private async found(what: string): Promise<Row[]> {
    const { anchors, fixes, images, shifts, shown } = this.store.state;
    switch (what) {
      case "anchor":
        return anchors.map((one) => ({
          title: String(one.id),
          about: one.properties.landmark
            ? `tied to ${one.properties.landmark}, ${metres(one.properties.residual_m)} off`
            : `loose: ${one.properties.reason}`,
          selection: { what: "anchor", id: String(one.id) },
          position: placeOf(one),
        }));
      case "fix":
        return fixes.map((one) => ({
          title: moment(one.properties.stamp_ns),
          about: `${one.properties.vehicle}: ${one.properties.reason}`,
          selection: { what: "fix", id: String(one.id) },
          position: placeOf(one),
        }));
      case "image":
        return images.map((one) => ({
          title: one.image,
          about: counted(one.anchor_count, "anchor"),
          selection: { what: "image", id: one.image },
          position: (one.footprint?.coordinates[0]?.[0] as LonLat | undefined) ?? null,
        }));
      case "shift":
        return shifts.map((one) => ({
          title: one.properties.image,
          about: one.properties.refused ?? `off by ${metres(one.properties.length_m)}`,
          selection: { what: "shift", id: shiftId(one) },
          position: placeOf(one),
        }));
      default:
        return this.landmarks(shown);
    }
  }

  private async landmarks(shown: number | null): Promise<Row[]> {
    const page = await this.api.landmarksIn(this.view.box(), shown, LISTED_MOST);
    return page.features.map(({ properties, geometry }) => ({
      title: properties.landmark,
      about: `${properties.kind}, 95 % within ${metres(properties.sigma_major_m * SIGMAS_95)}`,
      selection: { what: "landmark", id: properties.landmark },
      position: geometry.coordinates as LonLat,
    }));
  }

  private render(): void {
    const wanted = this.search.value.trim().toLowerCase();
    const found = this.rows.filter((row) => `${row.title} ${row.about}`.toLowerCase().includes(wanted));
    const shown = found.slice(0, LISTED_MOST);
    const more = this.rows.length >= LISTED_MOST ? ` of the first ${LISTED_MOST}; zoom in for others` : "";
    this.count.textContent = `${counted(found.length, "entry").replace("entrys", "entries")}${more}`;
    fill(
      this.list,
      ...shown.map(({ title, about, selection, position }) => {
        const row = button("", () => this.choose(selection, position), { class: "row" });
        fill(row, el("span", {}, title, el("small", {}, about)));
        return el("li", {}, row);
      }),
    );
  }
}
