/** The parts of the page put together, once the map has a version. */
import type { MapApi } from "./api.ts";
import { el, fill } from "./dom.ts";
import { Labelling } from "./labelling/labelling.ts";
import type { MapView, Pointed } from "./map/mapView.ts";
import { MapData } from "./mapData.ts";
import { DetailsCard } from "./panels/detailsCard.ts";
import { LabelPanel } from "./panels/labelPanel.ts";
import { LayersPanel } from "./panels/layersPanel.ts";
import { ListPanel } from "./panels/listPanel.ts";
import { NextPanel } from "./panels/nextPanel.ts";
import { Tabs } from "./panels/tabs.ts";
import { VersionBar } from "./panels/versionBar.ts";
import type { Speech } from "./speech.ts";
import type { Selection, Store } from "./state.ts";
import type { LonLat, Suggestion } from "./wire.ts";

/** The places on the page the parts go to. */
export interface Places {
  canvas: HTMLElement;
  versions: HTMLElement;
  panel: HTMLElement;
}

const SELECTED_BY: Partial<Record<Pointed["layer"], Selection["what"]>> = {
  anchors: "anchor",
  landmarks: "landmark",
  suggestions: "landmark",
  fixes: "fix",
  shifts: "shift",
  "footprints-fill": "image",
};

export class Viewer {
  private readonly data: MapData;
  private readonly labelling: Labelling;
  private readonly layers: LayersPanel;
  private readonly tabs: Tabs;

  constructor(
    private readonly api: MapApi,
    private readonly store: Store,
    private readonly view: MapView,
    speech: Speech,
    places: Places,
    token: HTMLElement,
  ) {
    this.data = new MapData(api, this.view, store);
    this.labelling = new Labelling(api, this.view, store, speech);
    this.layers = new LayersPanel(store, (group, shown) => this.showGroup(group, shown));
    const next = new NextPanel(store, this.view, speech, (one) => this.labelSuggested(one));
    const label = new LabelPanel(store, this.labelling, this.view, token);
    const list = new ListPanel(api, store, this.view, (selection, position) => this.choose(selection, position));
    this.tabs = new Tabs([
      { id: "layers", title: "Layers", content: this.layers.element, shown: () => void list.show(false) },
      { id: "label", title: "Label", content: label.element, shown: () => void list.show(false) },
      { id: "next", title: "Next", content: next.element, shown: () => this.offerSuggestions(list) },
      { id: "list", title: "List", content: list.element, shown: () => void this.list(list) },
    ]);
    const scrolled = el("div", { class: "scrolled" }, this.details().element, this.tabs.panels);
    fill(places.panel, this.tabs.list, scrolled);
    fill(places.versions, new VersionBar(store, (wanted, following) => this.showVersion(wanted, following)).element);
    this.view.whenPointed((at, pointed) => this.pointed(at, pointed));
    store.on(["link"], ({ link }) => void this.follow(link.newest));
  }

  /** The aerial images and maps the service has, under everything else. */
  async offerRasters(): Promise<void> {
    const rasters = await this.api.rasters();
    for (const raster of rasters) this.view.addRaster(raster);
    this.layers.offerRasters(rasters);
  }

  /** The images that were registered to the ortho layer, to be shown beside the map. */
  async offerShifts(): Promise<void> {
    this.layers.offerShifts(await this.data.registeredImages(), (image, shown) => this.data.showShifts(image, shown));
  }

  /** Shows the newest version, and what is under way to the next. */
  async begin(): Promise<void> {
    await this.refresh();
    await this.labelling.resume();
  }

  /** Shows a version again as the service has it: somebody else may ask now. */
  async refresh(): Promise<void> {
    const { shown } = this.store.state;
    if (shown !== null) await this.showWhole(shown);
  }

  private details(): DetailsCard {
    return new DetailsCard(this.api, this.store, {
      select: (selection) => this.store.set({ selection, ...(selection ? {} : { selectedAt: null }) }),
      labelHere: (position) => this.labelAt(position),
      retract: (anchor, image, reason) => this.labelling.retract(anchor, image, reason),
    });
  }

  private showVersion(version: number, following: boolean): void {
    const changed = version !== this.store.state.shown;
    this.store.set({ shown: version, following });
    if (changed) void this.showWhole(version);
  }

  private async showWhole(version: number): Promise<void> {
    await this.data.showVersion(version);
    const { selection } = this.store.state;
    if (selection) this.store.set({ selection: { ...selection } }); // its facts are another version's now
    if (this.tabs.isOpen("next")) await this.data.suggest(version);
  }

  private async follow(newest: number | null): Promise<void> {
    const known = this.store.state.versions?.map_version ?? null;
    if (newest === null || newest === known) return;
    this.store.set({ versions: await this.api.versions() });
    if (this.store.state.following) this.showVersion(newest, true);
  }

  private async showGroup(group: string, shown: boolean): Promise<string> {
    this.view.show(group, shown);
    if (shown) await this.data.showDriven(group);
    return "";
  }

  private offerSuggestions(list: ListPanel): void {
    void list.show(false);
    this.layers.switch("suggestions", true);
    const { shown } = this.store.state;
    if (shown !== null) void this.suggest(shown);
  }

  private async suggest(version: number): Promise<void> {
    await this.data.suggest(version);
    const places = this.store.state.suggestions?.suggestions.map((one) => one.position) ?? [];
    if (this.store.state.selectedAt === null) this.view.overview(places);
  }

  private async list(list: ListPanel): Promise<void> {
    if (!this.store.state.fixes.length) await this.data.showDriven("fixes");
    await list.show(true);
  }

  private pointed(at: LonLat, pointed: Pointed | null): void {
    if (this.tabs.isOpen("label")) {
      this.labelling.place(at);
      return;
    }
    const what = pointed ? SELECTED_BY[pointed.layer] : undefined;
    this.store.set(pointed && what ? { selection: { what, id: pointed.id } } : { selection: null, selectedAt: null });
  }

  private choose(selection: Selection, position: LonLat | null): void {
    this.store.set({ selection });
    if (position) this.view.goTo(position);
  }

  private labelAt(position: LonLat): void {
    this.store.set({ selection: null, selectedAt: null });
    this.tabs.open("label");
    this.view.goTo(position);
    this.labelling.place(position);
    this.labelling.focusMarker();
  }

  private labelSuggested(one: Suggestion): void {
    const image = one.image || one.image_choices[0];
    if (image) this.labelling.chooseImage(image);
    this.labelAt(one.position);
  }
}

/** The page's frame: head, map, versions, panel. */
export function frame(root: HTMLElement, head: readonly HTMLElement[]): Places {
  const canvas = el("div", { class: "canvas", role: "region", "aria-label": "Map" });
  const versions = el("div", { class: "version-place" });
  const panel = el("div", { class: "panel-body" });
  const aside = el("main", { class: "panel", id: "panel", tabindex: "-1" }, el("header", {}, ...head), panel);
  fill(root, el("div", { class: "stage" }, canvas, versions), aside);
  return { canvas, versions, panel };
}
