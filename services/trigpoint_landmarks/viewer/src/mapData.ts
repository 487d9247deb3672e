/** Gets what belongs to the version that is shown, and has it drawn. */
import { type MapApi, Refused, said } from "./api.ts";
import { fittedFactor } from "./map/exaggeration.ts";
import {
  anchorPoints,
  collected,
  type Drawn,
  ellipses,
  footprints,
  offsetArrows,
  point,
  residualArrows,
  shiftArrows,
  suggestionRings,
} from "./map/features.ts";
import type { MapView } from "./map/mapView.ts";
import type { FeatureSource } from "./map/style.ts";
import type { Store, ViewerState } from "./state.ts";
import { counted, metres } from "./text.ts";
import type { AerialImage, RegisteredImage, Shifts } from "./wire.ts";

const ELLIPSE_LEAST_PX = 1.5; // smaller ones are under their landmark's dot

function imageTitle({ image, offset_x_m: x, offset_y_m: y }: AerialImage): string {
  return x === null || y === null ? image : `${image}: off by ${metres(Math.hypot(x, y))}`;
}

/** How many of an image's tiles tell its shift, and of which map version. */
function shiftsSaid(tiles: Shifts["features"]): string {
  const accepted = tiles.filter((tile) => tile.properties.refused === null).length;
  const version = tiles[0]?.properties.map_version ?? "unknown";
  return `${accepted} of ${counted(tiles.length, "tile")} tell; map version ${version}`;
}

/** What an older service, or one without this, answers is as good as nothing. */
async function orNothing<T>(asked: Promise<T>, nothing: T): Promise<T> {
  try {
    return await asked;
  } catch (error) {
    if (error instanceof Refused && error.status === 404) return nothing;
    throw error;
  }
}

export class MapData {
  private latest = 0;

  constructor(
    private readonly api: MapApi,
    private readonly view: MapView,
    private readonly store: Store,
  ) {
    store.on(["anchors", "arrowFactor", "crs"], (state) => this.drawAnchors(state));
    store.on(["images", "arrowFactor", "crs"], (state) => this.drawImages(state));
    store.on(["shifts", "arrowFactor"], ({ shifts, arrowFactor }) => {
      view.draw("shifts", shiftArrows(shifts, arrowFactor));
    });
    store.on(["suggestions"], ({ suggestions }) => {
      view.draw("suggestions", suggestionRings(suggestions?.suggestions ?? []));
    });
    store.on(["selectedAt"], ({ selectedAt }) => view.draw("selected", point(selectedAt)));
    store.on(["ellipseFactor", "crs"], () => this.drawEllipses());
    store.on(["arrowsFitted", "anchors", "shifts"], () => this.fitArrows());
    view.whenSettled(() => {
      this.fitArrows();
      this.drawEllipses();
    });
  }

  /** Everything of a version; of several asked for at once the last stays. */
  async showVersion(version: number): Promise<void> {
    this.latest = version;
    this.view.showVersion(version);
    try {
      const [anchors, images] = await Promise.all([this.api.anchors(version), orNothing(this.api.images(version), [])]);
      if (this.latest === version) this.store.set({ anchors, images, trouble: "" });
    } catch (error) {
      if (this.latest === version) this.store.set({ trouble: said(error) });
    }
  }

  /** What one more anchor would bring in a version. */
  async suggest(version: number): Promise<void> {
    const suggestions = await orNothing(this.api.suggestions(version), null);
    if (this.latest === version) this.store.set({ suggestions });
  }

  /** Paths as driven and fixes: they stand in the log, whatever version is shown. */
  async showDriven(group: string): Promise<void> {
    if (group === "fixes") {
      const fixes = await this.api.rejectedFixes();
      const points = fixes.features.map((one) => ({ ...one, properties: { id: one.id } }));
      this.store.set({ fixes: fixes.features });
      this.view.draw("fixes", collected(points));
    } else if (group === "filtered" || group === "odometry") {
      this.view.draw(group satisfies FeatureSource, (await this.api.paths(group)) as unknown as Drawn);
    }
  }

  /** The images that were registered to the ortho layer. */
  registeredImages(): Promise<RegisteredImage[]> {
    return orNothing(this.api.registeredImages(), []);
  }

  /** The shift of an image against the ortho layer, or no longer; what is to be said of it. */
  async showShifts(image: string, shown: boolean): Promise<string> {
    const others = () => this.store.state.shifts.filter((tile) => tile.properties.image !== image);
    if (!shown) {
      this.store.set({ shifts: others() });
      return "";
    }
    const { features } = await this.api.shifts(image);
    this.store.set({ shifts: [...others(), ...features] });
    return shiftsSaid(features);
  }

  private drawAnchors({ anchors, crs, arrowFactor }: ViewerState): void {
    this.view.draw("anchors", anchorPoints(anchors));
    this.view.draw("residuals", residualArrows(anchors, crs, arrowFactor));
  }

  private drawImages({ images, crs, arrowFactor }: ViewerState): void {
    this.view.draw("footprints", footprints(images, imageTitle));
    this.view.draw("offsets", offsetArrows(images, crs, arrowFactor));
  }

  private fitArrows(): void {
    const { anchors, shifts, arrowsFitted } = this.store.state;
    const lengths = [
      ...anchors.map((one) => one.properties.residual_m),
      ...shifts.map((one) => one.properties.length_m),
    ].filter((one) => one !== null);
    if (arrowsFitted && lengths.length) {
      this.store.set({ arrowFactor: fittedFactor(lengths, this.view.pixelM()) });
    }
  }

  private drawn = "";

  private drawEllipses(): void {
    const { crs, ellipseFactor } = this.store.state;
    const leastM = ELLIPSE_LEAST_PX * this.view.pixelM();
    const found = ellipses(this.view.landmarks(), crs, ellipseFactor, leastM);
    const drawn = JSON.stringify(found);
    if (drawn === this.drawn) return; // drawing them again would unsettle the view again
    this.drawn = drawn;
    this.view.draw("ellipses", found);
  }
}
