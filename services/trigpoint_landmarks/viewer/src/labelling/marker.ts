/** The label's marker on the map: dragged, or moved by the arrow keys. */
import { Marker } from "maplibre-gl";
import { el } from "../dom.ts";
import type { MapView } from "../map/mapView.ts";
import type { LonLat } from "../wire.ts";
import { nudged } from "./draft.ts";

export class LabelMarker {
  private readonly element = el("div", {
    class: "label-marker",
    tabindex: "0",
    role: "button",
    "aria-roledescription": "movable marker",
    "aria-label": "Label position. Arrow keys move it by 0.1 m, with Shift by 1 m, with Alt by 1 cm.",
  });
  private readonly marker = new Marker({ element: this.element, draggable: true });

  constructor(
    private readonly view: MapView,
    private readonly changed: (position: LonLat) => void,
  ) {
    this.marker.on("drag", () => this.tell());
    this.element.addEventListener("keydown", (event) => this.key(event));
    this.element.addEventListener("click", (event) => event.stopPropagation());
  }

  put(position: LonLat | null): void {
    if (position) this.marker.setLngLat(position).addTo(this.view.map);
    else this.marker.remove();
  }

  focus(): void {
    this.element.focus();
  }

  private tell(): void {
    this.changed(this.marker.getLngLat().toArray() as LonLat);
  }

  private key(event: KeyboardEvent): void {
    const wanted = nudged(this.marker.getLngLat().toArray() as LonLat, event);
    if (!wanted) return;
    event.preventDefault();
    event.stopPropagation();
    this.marker.setLngLat(wanted);
    this.tell();
  }
}
