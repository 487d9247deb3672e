/** Where an anchor is labelled: place, image, sigma; what it would be tied to; submitted and awaited. */
import { said } from "../api.ts";
import { button, el, facts, field, fill, options } from "../dom.ts";
import { obstacle } from "../labelling/draft.ts";
import type { Labelling } from "../labelling/labelling.ts";
import type { MapView } from "../map/mapView.ts";
import type { Store } from "../state.ts";
import { metres } from "../text.ts";
import type { Association, LonLat } from "../wire.ts";

const SURVEY = "";
const ANOTHER = "\u0000another";

function verdict({
  landmark,
  landmark_kind: kind,
  distance_m: distance,
  explanation,
  reason,
}: Association): HTMLElement {
  const title = landmark
    ? `Will be tied to ${kind ?? "landmark"} ${landmark}`
    : distance === null
      ? "Nothing to tie it to"
      : "Will be tied to nothing";
  return el("div", {}, el("strong", {}, title), el("p", {}, explanation || reason));
}

function reasons(association: Association): HTMLElement {
  const { distance_m, corrected_distance_m, gate_m, runner_up, already_anchored_by } = association;
  const gain = association.expected_variance_reduction_m2;
  return facts([
    ["Distance", distance_m === null ? null : metres(distance_m)],
    ["Less the image's offset", corrected_distance_m === null ? null : metres(corrected_distance_m)],
    ["Gate", gate_m === null ? null : metres(gate_m)],
    ["Next nearest", runner_up ? `${runner_up.landmark}, ${metres(runner_up.distance_m)} away` : null],
    ["Anchored by", already_anchored_by.join(", ") || null],
    ["It would take off", gain === null ? null : `${gain.toPrecision(2)} m² of the map's variance`],
  ]);
}

export class LabelPanel {
  readonly element: HTMLElement;
  private readonly latitude = el("input", { id: "label-lat", inputmode: "decimal", autocomplete: "off" });
  private readonly longitude = el("input", { id: "label-lon", inputmode: "decimal", autocomplete: "off" });
  private readonly image = el("select", { id: "label-image" });
  private readonly imageName = el("input", { id: "label-image-name", maxlength: "200", autocomplete: "off" });
  private readonly otherImage = field("Name of the image", this.imageName);
  private readonly sigma = el("input", { id: "label-sigma", inputmode: "decimal", value: "0.10", autocomplete: "off" });
  private readonly imageSigma = el("input", { id: "label-image-sigma", inputmode: "decimal", value: "0.35" });
  private readonly anchor = el("input", { id: "label-name", maxlength: "200", autocomplete: "off" });
  private readonly preview = el("div", { class: "card verdict", "aria-live": "polite" });
  private readonly progress = el("ul", { class: "progress" });
  private readonly trouble = el("p", { class: "trouble", role: "alert" });
  private readonly submit = el("button", { class: "primary" }, "Submit label");

  constructor(
    private readonly store: Store,
    private readonly labelling: Labelling,
    private readonly view: MapView,
    token: HTMLElement,
  ) {
    this.element = el(
      "form",
      { class: "labelling", onsubmit: (event: SubmitEvent) => void this.submitted(event), novalidate: true },
      el("h2", {}, "Label an anchor"),
      el("p", { class: "muted" }, "Click the map where an aerial image shows a landmark, or set the marker down here."),
      this.progress,
      this.placing(),
      this.preview,
      this.naming(),
      el(
        "div",
        { class: "actions" },
        this.submit,
        button("Clear", () => labelling.clear()),
      ),
      this.trouble,
    );
    this.element = el("div", { class: "label-body" }, this.element, token);
    store.on(["images"], () => this.offerImages());
    store.on(["access"], ({ access }) => {
      this.submit.disabled = access?.can_label === false;
    });
    labelling.on(() => this.render());
    this.render();
  }

  private placing(): HTMLElement {
    const moved = () => {
      const position: LonLat = [Number(this.longitude.value), Number(this.latitude.value)];
      if (position.every(Number.isFinite)) this.labelling.place(position);
    };
    this.latitude.addEventListener("change", moved);
    this.longitude.addEventListener("change", moved);
    const middle = button("Set marker in the middle of the map", () => {
      this.labelling.place(this.view.map.getCenter().toArray() as LonLat);
      this.labelling.focusMarker();
    });
    const hint = "Arrow keys move the marker by 0.1 m, with Shift by 1 m, with Alt by 1 cm.";
    return el(
      "fieldset",
      {},
      el("legend", {}, "Where"),
      middle,
      el("p", { class: "hint" }, hint),
      el("div", { class: "pair" }, field("Latitude °", this.latitude), field("Longitude °", this.longitude)),
    );
  }

  private naming(): HTMLElement {
    const changed = () => this.labelling.change(this.entered());
    const chosen = () => this.labelling.chooseImage(this.entered().image);
    this.image.addEventListener("change", chosen);
    this.imageName.addEventListener("change", chosen);
    for (const control of [this.sigma, this.imageSigma, this.anchor]) {
      control.addEventListener("change", changed);
    }
    this.offerImages();
    return el(
      "fieldset",
      {},
      el("legend", {}, "What"),
      field("Image", this.image),
      this.otherImage,
      el("div", { class: "pair" }, field("Sigma, m", this.sigma), field("Image's own sigma, m", this.imageSigma)),
      field("Name", this.anchor),
    );
  }

  private entered() {
    const image = this.image.value === ANOTHER ? this.imageName.value.trim() : this.image.value;
    return {
      image,
      sigma_m: Number(this.sigma.value),
      image_sigma_m: Number(this.imageSigma.value),
      anchor: this.anchor.value,
    };
  }

  private offerImages(): void {
    const known = this.store.state.images.map(({ image }) => image).filter(Boolean);
    options(this.image, [
      ...known.map((name) => [name, name] as const),
      [ANOTHER, "Another image…"],
      [SURVEY, "None: a survey"],
    ]);
    this.otherImage.hidden = this.image.value !== ANOTHER;
  }

  private render(): void {
    const { draft, association, trouble } = this.labelling;
    this.showImage(draft.image);
    this.otherImage.hidden = this.image.value !== ANOTHER;
    this.latitude.value = draft.position ? draft.position[1].toFixed(8) : "";
    this.longitude.value = draft.position ? draft.position[0].toFixed(8) : "";
    if (document.activeElement !== this.anchor) this.anchor.value = draft.anchor;
    this.preview.hidden = !draft.position;
    this.preview.dataset.tied = String(Boolean(association?.landmark));
    if (association) fill(this.preview, verdict(association), reasons(association));
    else fill(this.preview, el("p", {}, trouble || "Asking what it would be tied to…"));
    this.renderProgress();
  }

  /** The image as it is in the draft: one of those known, or another whose name is being typed. */
  private showImage(image: string): void {
    const known = [...this.image.options].some((one) => one.value === image);
    if (known && (image || this.image.value !== ANOTHER)) this.image.value = image;
  }

  private renderProgress(): void {
    const { awaited, news } = this.labelling;
    const waiting = awaited.map((one) => {
      const text = one.what === "label" ? "is in the log" : "is retracted in the log";
      return el("li", { class: "waiting" }, `${one.anchor} ${text}; waiting for the next map version…`);
    });
    fill(this.progress, ...waiting, ...news.map((text) => el("li", {}, text)));
  }

  private async submitted(event: SubmitEvent): Promise<void> {
    event.preventDefault();
    this.trouble.textContent = "";
    if (this.labelling.draft.position) this.labelling.change(this.entered());
    const why = obstacle(this.labelling.draft);
    if (why) {
      this.trouble.textContent = why;
      return;
    }
    try {
      await this.labelling.submit();
    } catch (error) {
      this.trouble.textContent = said(error);
    }
  }
}
