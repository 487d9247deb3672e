/** The map on the page: what is drawn where, and what somebody points at. */
import "maplibre-gl/dist/maplibre-gl.css";
import {
  type GeoJSONSource,
  Map as MapLibre,
  type MapMouseEvent,
  NavigationControl,
  prewarm,
  ScaleControl,
  setWorkerUrl,
  type VectorTileSource,
} from "maplibre-gl";
import workerUrl from "maplibre-gl/dist/maplibre-gl-worker.mjs?worker&url";
import type { MapApi } from "../api.ts";
import { tokenHeaders } from "../token.ts";
import type { Box, LonLat, Raster } from "../wire.ts";
import type { Drawn, UncertainPoint } from "./features.ts";
import { drawIcons } from "./icons.ts";
import { LAYER_GROUPS } from "./layerGroups.ts";
import { palette } from "./palette.ts";
import { dataLayers, type FeatureSource, rasterSource, styleOf, TILE_SOURCES } from "./style.ts";

const REACH_PX = 8; // from what is pointed at
const CLOSE_ZOOM = 20;
const AROUND_PX = { top: 32, left: 32, right: 56, bottom: 120 }; // the controls' room
const POINTED = ["anchors", "suggestions", "landmarks", "fixes", "shifts", "footprints-fill"] as const;

/** Something on the map, by its layer and id. */
export interface Pointed {
  layer: (typeof POINTED)[number];
  id: string;
}

setWorkerUrl(workerUrl);
prewarm();

export class MapView {
  readonly map: MapLibre;
  private readonly raised = new Map<FeatureSource, Drawn>();
  /** Done when the first picture is there: landmarks and paths, with what `draw` was given coming after them. */
  readonly drawn: Promise<void>;
  private opened = false;

  /** A version in a box. */
  constructor(
    container: HTMLElement,
    private readonly api: MapApi,
    box: Box,
    private version: number,
  ) {
    this.map = new MapLibre({
      container,
      style: styleOf(palette(), (layer) => api.tiles(layer, version)),
      bounds: box,
      fitBoundsOptions: { padding: AROUND_PX, maxZoom: CLOSE_ZOOM },
      maxZoom: 24,
      attributionControl: false,
      dragRotate: false,
      pitchWithRotate: false,
      touchPitch: false,
      fadeDuration: 0,
      locale: { "Map.Title": "Map. Arrow keys move it, plus and minus zoom; the List tab holds the same as text." },
      transformRequest: (url) => ({ url, headers: url.startsWith(api.base) ? tokenHeaders() : {} }),
    });
    this.map.touchZoomRotate.disableRotation();
    this.map.keyboard.disableRotation();
    this.map.addControl(new NavigationControl({ showCompass: false }), "top-right");
    this.map.addControl(new ScaleControl({ maxWidth: 120 }), "bottom-left");
    this.drawn = this.open();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
  }

  /** Called when the view has come to rest, or other landmarks are there. */
  whenSettled(call: () => void): void {
    this.map.on("idle", call);
  }

  whenPointed(call: (at: LonLat, pointed: Pointed | null) => void): void {
    this.map.on("click", (event) => call(event.lngLat.toArray() as LonLat, this.pointedAt(event)));
    this.map.on("mousemove", (event) => {
      this.map.getCanvas().style.cursor = this.pointedAt(event) ? "pointer" : "";
    });
  }

  draw(source: FeatureSource, features: Drawn): void {
    this.raised.set(source, features);
    if (this.opened) this.map.getSource<GeoJSONSource>(source)?.setData(features);
  }

  show(group: string, shown: boolean): void {
    const layers = LAYER_GROUPS.find((one) => one.id === group)?.layers ?? [`raster-${group}`];
    for (const layer of layers) {
      if (this.map.getLayer(layer)) this.map.setLayoutProperty(layer, "visibility", shown ? "visible" : "none");
    }
  }

  /** The tiles of another version, or those of this one again. */
  showVersion(version: number): void {
    this.version = version;
    for (const name of TILE_SOURCES) {
      this.map.getSource<VectorTileSource>(name)?.setTiles([this.api.tiles(name, this.version)]);
    }
  }

  addRaster(raster: Raster): void {
    const id = `raster-${raster.name}`;
    this.map.addSource(id, rasterSource(raster, this.api.base));
    this.map.addLayer({ type: "raster", id, source: id }, "footprints-fill");
  }

  /** The landmarks in view, each once. */
  landmarks(): UncertainPoint[] {
    const found = new Map<string, UncertainPoint>();
    for (const { properties, geometry } of this.map.querySourceFeatures("landmarks", { sourceLayer: "landmarks" })) {
      if (geometry.type !== "Point") continue;
      found.set(properties.landmark, {
        id: properties.landmark,
        kind: properties.kind,
        position: geometry.coordinates as LonLat,
        ellipse: {
          majorM: properties.sigma_major_m,
          minorM: properties.sigma_minor_m,
          headingRad: properties.ellipse_heading_rad,
        },
      });
    }
    return [...found.values()];
  }

  box(): Box {
    return this.map.getBounds().toArray().flat() as Box;
  }

  /** Metres of a pixel in the middle of the view. */
  pixelM(): number {
    const { lat } = this.map.getCenter();
    return (40_075_016.69 * Math.cos((lat * Math.PI) / 180)) / (512 * 2 ** this.map.getZoom());
  }

  /** Goes to where all of the places can be seen, unless one of them can be seen already. */
  overview(places: readonly LonLat[]): void {
    const view = this.map.getBounds();
    if (!places.length || places.some((place) => view.contains(place))) return;
    const lons = places.map(([lon]) => lon);
    const lats = places.map(([, lat]) => lat);
    const box: Box = [Math.min(...lons), Math.min(...lats), Math.max(...lons), Math.max(...lats)];
    this.map.fitBounds(box, { padding: AROUND_PX, maxZoom: CLOSE_ZOOM });
  }

  /** Goes to a place; near enough to see single landmarks where `close`. */
  goTo(position: LonLat, close = true): void {
    this.map.easeTo({ center: position, zoom: close ? Math.max(this.map.getZoom(), CLOSE_ZOOM) : this.map.getZoom() });
  }

  /** Every kind of layer costs its shaders: what is not in the first picture waits for it. */
  private async open(): Promise<void> {
    await this.map.once("load");
    this.opened = true;
    drawIcons(this.map, palette());
    for (const [source, features] of this.raised) this.draw(source, features);
  }

  private recolour(): void {
    const colours = palette();
    this.map.setPaintProperty("ground", "background-color", colours.ground);
    if (!this.opened) return;
    drawIcons(this.map, colours);
    for (const { id, paint } of dataLayers(colours)) {
      for (const [name, value] of Object.entries(paint ?? {})) {
        this.map.setPaintProperty(id, name as "line-color", value as string);
      }
    }
  }

  private pointedAt({ point: { x, y } }: MapMouseEvent): Pointed | null {
    const corners: [[number, number], [number, number]] = [
      [x - REACH_PX, y - REACH_PX],
      [x + REACH_PX, y + REACH_PX],
    ];
    const found = this.map.queryRenderedFeatures(corners, { layers: [...POINTED] });
    for (const layer of POINTED) {
      const feature = found.find((one) => one.layer.id === layer);
      if (feature) return { layer, id: String(feature.properties[layer === "landmarks" ? "landmark" : "id"]) };
    }
    return null;
  }
}
