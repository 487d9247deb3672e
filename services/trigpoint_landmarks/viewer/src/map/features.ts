/** What is known of the map as features to be drawn. */
import type { Feature, FeatureCollection, Geometry } from "geojson";
import {
  arrowLines,
  circleRing,
  type Ellipse,
  ellipseRing,
  gridConvergenceRad,
  metresBetween,
  SIGMAS_95,
  trueFromGrid,
} from "../geo.ts";
import type { AerialImage, AnchorFeature, Association, LonLat, ShiftFeature, Suggestion } from "../wire.ts";

export type Drawn = FeatureCollection<Geometry, Record<string, unknown>>;

export function collected(features: Feature<Geometry, Record<string, unknown>>[]): Drawn {
  return { type: "FeatureCollection", features };
}

function drawn(geometry: Geometry, properties: Record<string, unknown> = {}): Drawn["features"][number] {
  return { type: "Feature", geometry, properties };
}

export interface UncertainPoint {
  id: string;
  kind: string;
  position: LonLat;
  /** The 1-sigma ellipse on the grid. */
  ellipse: Ellipse;
}

/** The 95 % ellipses, `factor` times as large as they are, of those at least so large in metres when drawn. */
export function ellipses(points: readonly UncertainPoint[], crs: string, factor: number, leastM: number): Drawn {
  const scale = SIGMAS_95 * factor;
  const large = points.filter((point) => point.ellipse.majorM * scale >= leastM);
  return collected(
    large.map(({ kind, position, ellipse }) => {
      const grown = { ...ellipse, majorM: ellipse.majorM * scale, minorM: ellipse.minorM * scale };
      const ring = ellipseRing(position, grown, gridConvergenceRad(crs, position));
      return drawn({ type: "Polygon", coordinates: [ring] }, { kind });
    }),
  );
}

/** The anchors that have a place, where they were labelled. */
export function anchorPoints(anchors: readonly AnchorFeature[]): Drawn {
  return collected(
    anchors.flatMap((anchor) =>
      anchor.geometry ? [drawn(anchor.geometry, { id: anchor.id, landmark: anchor.properties.landmark })] : [],
    ),
  );
}

/** An arrow for each tied anchor: from the label to where the map has it, `factor` times as long as it is. */
export function residualArrows(anchors: readonly AnchorFeature[], crs: string, factor: number): Drawn {
  return collected(
    anchors.flatMap(({ geometry, properties }) => {
      const { residual_x_m: x, residual_y_m: y } = properties;
      if (!geometry || x === null || y === null) return [];
      const at = geometry.coordinates as LonLat;
      const vector = trueFromGrid([-x * factor, -y * factor], gridConvergenceRad(crs, at));
      return [drawn({ type: "MultiLineString", coordinates: arrowLines(at, vector) })];
    }),
  );
}

function centre(ring: readonly LonLat[]): LonLat {
  const sum = ring.slice(1).reduce(([lon, lat], one) => [lon + one[0], lat + one[1]] as LonLat, [0, 0] as LonLat);
  return [sum[0] / (ring.length - 1), sum[1] / (ring.length - 1)];
}

export function footprints(images: readonly AerialImage[], title: (image: AerialImage) => string): Drawn {
  return collected(
    images.flatMap((image) =>
      image.footprint ? [drawn(image.footprint, { id: image.image, title: title(image) })] : [],
    ),
  );
}

/** Each image's offset as an arrow from the middle of its footprint, `factor` times as long as it is. */
export function offsetArrows(images: readonly AerialImage[], crs: string, factor: number): Drawn {
  return collected(
    images.flatMap(({ footprint, offset_x_m: x, offset_y_m: y }) => {
      const ring = footprint?.coordinates[0] as LonLat[] | undefined;
      if (!ring || x === null || y === null) return [];
      const at = centre(ring);
      const vector = trueFromGrid([x * factor, y * factor], gridConvergenceRad(crs, at));
      return [drawn({ type: "MultiLineString", coordinates: arrowLines(at, vector) })];
    }),
  );
}

/** The name of a tile among all that are shown. */
export function shiftId({ properties, geometry }: ShiftFeature): string {
  return `${properties.image} at ${geometry.coordinates.join(" ")}`;
}

/** The tiles' middles, and from each that tells an arrow to where the image shows it, `factor` times as long as it is. */
export function shiftArrows(tiles: readonly ShiftFeature[], factor: number): Drawn {
  return collected(
    tiles.flatMap((tile) => {
      const { shown_lon_deg: lon, shown_lat_deg: lat, length_m } = tile.properties;
      const at = tile.geometry.coordinates as LonLat;
      const middle = drawn(tile.geometry, { id: shiftId(tile), length_m });
      if (lon === null || lat === null) return [middle];
      const [eastM, northM] = metresBetween(at, [lon, lat]);
      const lines = arrowLines(at, [eastM * factor, northM * factor]);
      return [middle, drawn({ type: "MultiLineString", coordinates: lines }, { length_m })];
    }),
  );
}

const RING_PX = { least: 9, more: 16 };

/** The places where an anchor would help, each ring's area by how much. */
export function suggestionRings(suggestions: readonly Suggestion[]): Drawn {
  const most = Math.max(...suggestions.map((one) => one.variance_reduction_m2), Number.MIN_VALUE);
  return collected(
    suggestions.map(({ rank, landmark, position, variance_reduction_m2: gain }) => {
      const radius = RING_PX.least + RING_PX.more * Math.sqrt(Math.max(gain, 0) / most);
      return drawn({ type: "Point", coordinates: position }, { id: landmark, rank, radius });
    }),
  );
}

/** A label that might be: the gate around it, the landmark it would be tied to, and the next one. */
export function prospect(at: LonLat, association: Association | null): Drawn {
  if (!association) return collected([]);
  const { gate_m: gateM, landmark, landmark_position: nearest, runner_up: rival } = association;
  const line = (to: LonLat, part: string) => drawn({ type: "LineString", coordinates: [at, to] }, { part });
  return collected([
    ...(gateM === null ? [] : [drawn({ type: "Polygon", coordinates: [circleRing(at, gateM)] }, { part: "gate" })]),
    ...(nearest === null ? [] : [line(nearest, landmark ? "tie" : "rival")]),
    ...(rival === null ? [] : [line(rival.position, "rival")]),
  ]);
}

export function point(position: LonLat | null): Drawn {
  return collected(position ? [drawn({ type: "Point", coordinates: position })] : []);
}
