/** Everything that is known of the thing that was pointed at. */
import { type MapApi, said } from "../api.ts";
import { button, type Child, el, facts, fill } from "../dom.ts";
import { SIGMAS_95 } from "../geo.ts";
import { shiftId } from "../map/features.ts";
import type { Selection, Store } from "../state.ts";
import { degrees, metres, moment, percent } from "../text.ts";
import type { AerialImage, AnchorFeature, FixFeature, LandmarkFeature, LonLat, ShiftFeature } from "../wire.ts";

const DEGREES = 180 / Math.PI;

export interface DetailActions {
  select(selection: Selection | null): void;
  labelHere(position: LonLat): void;
  retract(anchor: string, image: string, reason: string): Promise<void>;
}

function versionsOf({ valid_from_version: from, valid_to_version: to }: LandmarkFeature["properties"]): string {
  return to === null ? `since version ${from}` : `versions ${from} to ${to - 1}`;
}

export class DetailsCard {
  readonly element = el("section", { class: "card details", "aria-label": "Details", hidden: true });
  private asked = 0;

  constructor(
    private readonly api: MapApi,
    private readonly store: Store,
    private readonly actions: DetailActions,
  ) {
    store.on(["selection", "anchors", "images"], () => void this.render());
  }

  private async render(): Promise<void> {
    const { selection } = this.store.state;
    this.element.hidden = selection === null;
    if (selection === null) return;
    this.asked += 1;
    const number = this.asked;
    try {
      const content = await this.content(selection);
      if (number === this.asked) fill(this.element, ...content);
    } catch (error) {
      if (number === this.asked)
        fill(this.element, ...this.head(selection.id, ""), el("p", { class: "trouble" }, said(error)));
    }
  }

  private async content(selection: Selection): Promise<Child[]> {
    const { anchors, fixes, images, shifts, shown } = this.store.state;
    switch (selection.what) {
      case "landmark":
        return this.ofLandmark(await this.api.landmark(selection.id, shown));
      case "anchor":
        return this.ofAnchor(anchors.find((one) => one.id === selection.id));
      case "fix":
        return this.ofFix(fixes.find((one) => one.id === selection.id));
      case "image":
        return this.ofImage(images.find((one) => one.image === selection.id));
      case "shift":
        return this.ofShift(shifts.find((one) => shiftId(one) === selection.id));
    }
  }

  private head(title: string, kind: string): Child[] {
    const close = button("×", () => this.actions.select(null), { class: "icon close", "aria-label": "Close details" });
    return [el("h2", {}, title, kind ? el("span", { class: "tag" }, kind) : null), close];
  }

  private ofLandmark({ properties, geometry }: LandmarkFeature): Child[] {
    const position = geometry.coordinates as LonLat;
    this.store.set({ selectedAt: position });
    const major = metres(properties.sigma_major_m * SIGMAS_95);
    const minor = metres(properties.sigma_minor_m * SIGMAS_95);
    const heading = `${((properties.ellipse_heading_rad * DEGREES + 360) % 180).toFixed(0)}° from grid east`;
    return [
      ...this.head(properties.landmark, properties.kind),
      facts([
        ["Position", degrees(position)],
        ["On the grid", `${properties.easting_m.toFixed(3)} m E, ${properties.northing_m.toFixed(3)} m N`],
        ["95 % ellipse", `${major} × ${minor}, ${heading}`],
        ["1-sigma", `${metres(properties.sigma_major_m)} × ${metres(properties.sigma_minor_m)}`],
        ["Observed", `${properties.observation_count} times by ${properties.vehicles.join(", ")}`],
        ["Seen", `${moment(properties.first_seen_ns)} to ${moment(properties.last_seen_ns)}`],
        ["Signature", properties.signature || null],
        ["As it is", versionsOf(properties)],
        ["Anchors", this.anchorsOf(properties.landmark)],
      ]),
      el(
        "div",
        { class: "actions" },
        button("Label an anchor here", () => this.actions.labelHere(position)),
      ),
    ];
  }

  private anchorsOf(landmark: string): Child {
    const tied = this.store.state.anchors.filter((one) => one.properties.landmark === landmark);
    if (!tied.length) return "none is tied to it";
    const link = (one: AnchorFeature) =>
      button(
        `${one.id} (${metres(one.properties.residual_m)} off)`,
        () => this.actions.select({ what: "anchor", id: String(one.id) }),
        { class: "link" },
      );
    return el("span", {}, ...tied.map(link));
  }

  private ofAnchor(feature: AnchorFeature | undefined): Child[] {
    if (!feature) return [...this.head("Anchor", ""), el("p", {}, "It is not in this map version.")];
    const { anchor, image, kind, landmark, reason, sigma_m: sigma, residual_m: residual } = feature.properties;
    const position = (feature.geometry?.coordinates ?? null) as LonLat | null;
    this.store.set({ selectedAt: position });
    const toLandmark = button(landmark, () => this.actions.select({ what: "landmark", id: landmark }), {
      class: "link",
    });
    return [
      ...this.head(anchor, landmark ? "tied anchor" : "loose anchor"),
      facts([
        ["Tied to", landmark ? toLandmark : "no landmark"],
        ["Why", reason || null],
        ["Residual", residual === null ? null : metres(residual)],
        ["Label's sigma", metres(sigma)],
        ["Image", image || "none: a survey"],
        ["Kind", kind || null],
        ["Labelled at", position ? degrees(position) : "unknown"],
      ]),
      this.retraction(anchor, image),
    ];
  }

  private retraction(anchor: string, image: string): HTMLElement {
    const reason = el("input", { id: "retract-reason", maxlength: "200", autocomplete: "off" });
    const trouble = el("p", { class: "trouble", role: "alert" });
    const form = el(
      "form",
      { class: "retract", hidden: true },
      el("label", { for: "retract-reason" }, "Why (kept in the log)"),
      reason,
      el("div", { class: "actions" }, el("button", { class: "danger" }, `Retract ${anchor}`)),
      trouble,
    );
    const open = button("Retract…", () => {
      form.hidden = !form.hidden;
      open.setAttribute("aria-expanded", String(!form.hidden));
      if (!form.hidden) reason.focus();
    });
    open.setAttribute("aria-expanded", "false");
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      trouble.textContent = "";
      try {
        await this.actions.retract(anchor, image, reason.value);
        form.hidden = true;
      } catch (error) {
        trouble.textContent = said(error);
      }
    });
    return el("div", {}, el("div", { class: "actions" }, open), form);
  }

  private ofFix(feature: FixFeature | undefined): Child[] {
    if (!feature) return [...this.head("GNSS fix", ""), el("p", {}, "It is not known any more.")];
    const { properties, geometry } = feature;
    const { nis, limit, innovation_x_m: x, innovation_y_m: y } = properties;
    this.store.set({ selectedAt: geometry.coordinates as LonLat });
    return [
      ...this.head("GNSS fix", properties.accepted ? "accepted" : "rejected"),
      facts([
        ["Why", properties.reason],
        ["Off the track", x === null || y === null ? null : metres(Math.hypot(x, y))],
        ["Squared innovation", nis === null ? null : `${nis.toFixed(1)}, gate ${limit?.toFixed(1) ?? "none"}`],
        ["Stated sigma", properties.sigma_m === null ? null : metres(properties.sigma_m)],
        ["Vehicle", `${properties.vehicle}, boot ${properties.boot_id}`],
        ["Taken", moment(properties.stamp_ns)],
      ]),
    ];
  }

  private ofShift(tile: ShiftFeature | undefined): Child[] {
    if (!tile) return [...this.head("Shift", ""), el("p", {}, "It is not shown any more.")];
    const { image, refused, confidence, map_version: version, shift_east_m: x, shift_north_m: y } = tile.properties;
    const { sigma_east_m: sigmaX, sigma_north_m: sigmaY } = tile.properties;
    const position = tile.geometry.coordinates as LonLat;
    this.store.set({ selectedAt: position });
    return [
      ...this.head(`Shift of ${image}`, refused === null ? "measured" : "refused"),
      facts([
        ["Why", refused],
        ["Image shows the ground", x === null ? null : `${metres(x)} grid east, ${metres(y)} grid north of the layer`],
        ["Its 1-sigma", sigmaX === null ? null : `${metres(sigmaX)} east, ${metres(sigmaY)} north`],
        ["Confidence", percent(confidence)],
        ["Ortho layer", version === null ? null : `of map version ${version}`],
        ["Tile's middle", degrees(position)],
      ]),
    ];
  }

  private ofImage(image: AerialImage | undefined): Child[] {
    if (!image) return [...this.head("Aerial image", ""), el("p", {}, "No anchor of this version is labelled in it.")];
    const { offset_x_m: x, offset_y_m: y, footprint_source: source } = image;
    const known = x !== null && y !== null;
    return [
      ...this.head(image.image, "aerial image"),
      facts([
        ["Offset", known ? `${metres(x)} grid east, ${metres(y)} grid north` : "not estimated in this version"],
        ["Its 1-sigma", image.sigma_major_m === null ? null : metres(image.sigma_major_m)],
        ["Anchors", String(image.anchor_count)],
        ["Footprint", source === "labels" ? "drawn around its labels" : "as recorded"],
      ]),
    ];
  }
}
