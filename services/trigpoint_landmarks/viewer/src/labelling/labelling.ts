/** From a draft on the map to an anchor in the next version: asks what it would be tied to, submits, waits. */
import { type MapApi, Refused, said } from "../api.ts";
import { distanceM, SIGMAS_95 } from "../geo.ts";
import { prospect } from "../map/features.ts";
import type { MapView } from "../map/mapView.ts";
import type { Speech } from "../speech.ts";
import type { Store } from "../state.ts";
import { metres } from "../text.ts";
import type { Association, LonLat } from "../wire.ts";
import { type Arrived, type Awaited, settled, underway } from "./awaited.ts";
import { type Draft, EMPTY_DRAFT, freeName, imageAt, labelOf, obstacle } from "./draft.ts";
import { LabelMarker } from "./marker.ts";

const ASK_AFTER_MS = 120; // while somebody drags, not every pixel is asked for

export class Labelling {
  draft: Draft = EMPTY_DRAFT;
  association: Association | null = null;
  /** Why it is not known what the label would be tied to; "" where it is. */
  trouble = "";
  awaited: readonly Awaited[] = [];
  news: readonly string[] = [];
  private readonly marker: LabelMarker;
  private imageChosen = false;
  private timer = 0;
  private asking = new AbortController();
  private listeners: (() => void)[] = [];

  constructor(
    private readonly api: MapApi,
    private readonly view: MapView,
    private readonly store: Store,
    private readonly speech: Speech,
  ) {
    this.marker = new LabelMarker(view, (position) => this.place(position));
    store.on(["anchors", "shown"], ({ shown }) => void this.settle(shown));
  }

  /** Takes up what was submitted before this page was opened; the newest version is the one that is shown. */
  async resume(): Promise<void> {
    const { anchors, shown } = this.store.state;
    if (shown === null) return;
    this.awaited = underway(await this.api.labels(), anchors, shown);
    this.tell();
  }

  /** Told whenever anything of this is different. */
  on(listener: () => void): void {
    this.listeners.push(listener);
  }

  /** Puts the label somewhere; the rest of the draft stays. */
  place(position: LonLat): void {
    this.marker.put(position);
    const { anchors, images } = this.store.state;
    const anchor = this.draft.anchor || freeName(anchors.map((one) => one.properties.anchor));
    const image = this.imageChosen ? this.draft.image : imageAt(images, position);
    this.change({ position, anchor, image });
  }

  /** The image the label is in, whatever is under it; the place suggests one until then. */
  chooseImage(image: string): void {
    this.imageChosen = true;
    this.change({ image });
  }

  focusMarker(): void {
    this.marker.focus();
  }

  change(changed: Partial<Draft>): void {
    this.draft = { ...this.draft, ...changed };
    this.tell();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => void this.ask(), ASK_AFTER_MS);
  }

  /** Nothing is to be labelled any more. */
  clear(): void {
    const { image, sigma_m, image_sigma_m } = this.draft;
    this.imageChosen = false;
    this.draft = { ...EMPTY_DRAFT, image, sigma_m, image_sigma_m };
    this.marker.put(null);
    this.know(null);
  }

  /** Into the log. Throws what the service says against it. */
  async submit(): Promise<void> {
    const why = obstacle(this.draft);
    if (why) throw new Error(why);
    const label = labelOf(this.draft);
    await this.api.label(label);
    this.await({ what: "label", anchor: label.anchor, image: label.image, since: this.newest() });
    this.clear();
  }

  async retract(anchor: string, image: string, reason: string): Promise<void> {
    await this.api.retract(anchor, image, reason);
    this.await({ what: "retraction", anchor, image, since: this.newest() });
  }

  private newest(): number {
    return this.store.state.link.newest ?? 0;
  }

  private await(one: Awaited): void {
    this.awaited = [...this.awaited, one];
    const done = one.what === "label" ? "is labelled" : "is retracted";
    this.speech.say(`${one.anchor} ${done}: the next map version is awaited.`);
    this.tell();
  }

  private tell(): void {
    for (const listener of this.listeners) listener();
  }

  private know(association: Association | null, trouble = ""): void {
    this.association = association;
    this.trouble = trouble;
    this.view.draw("prospect", prospect(this.draft.position ?? [0, 0], this.draft.position ? association : null));
    this.tell();
  }

  private async ask(): Promise<void> {
    const { position, anchor: _, ...label } = this.draft;
    if (!position) return;
    this.asking.abort();
    this.asking = new AbortController();
    const { signal } = this.asking;
    try {
      this.know(await this.api.association({ position, ...label }, this.store.state.shown, signal));
    } catch (error) {
      if (signal.aborted) return;
      const unknown = error instanceof Refused && error.status === 404;
      this.know(null, unknown ? "This service does not say what a label would be tied to." : said(error));
    }
  }

  private async settle(shown: number | null): Promise<void> {
    if (shown === null || !this.awaited.length) return;
    const { arrived, waiting } = settled(this.awaited, shown, this.store.state.anchors);
    if (!arrived.length) return;
    this.awaited = waiting;
    for (const one of arrived) await this.report(one, shown);
  }

  private async report(arrived: Arrived, version: number): Promise<void> {
    const text = `Version ${version} is here: ${await this.outcome(arrived, version)}`;
    this.news = [text, ...this.news].slice(0, 5);
    this.speech.say(text);
    this.tell();
  }

  private async outcome({ awaited, anchor }: Arrived, version: number): Promise<string> {
    if (!anchor) return `${awaited.anchor} is retracted.`;
    const { landmark, reason, residual_m: residual } = anchor.properties;
    if (!landmark) return `${awaited.anchor} is tied to no landmark: ${reason}.`;
    const change = await this.changeOf(landmark, awaited.since, version);
    return `${awaited.anchor} is tied to ${landmark}, ${metres(residual)} off.${change}`;
  }

  /** How a landmark's place and certainty changed; "" where it was not there before. */
  private async changeOf(landmark: string, before: number, after: number): Promise<string> {
    try {
      const [was, is] = await Promise.all([this.api.landmark(landmark, before), this.api.landmark(landmark, after)]);
      const way = distanceM(was.geometry.coordinates as LonLat, is.geometry.coordinates as LonLat);
      const [from, to] = [was, is].map((one) => metres(one.properties.sigma_major_m * SIGMAS_95));
      return ` It moved ${metres(way)}; its 95 % radius went from ${from} to ${to}.`;
    } catch (error) {
      if (error instanceof Refused && error.status === 404) return "";
      throw error;
    }
  }
}
