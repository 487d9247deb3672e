/** What the service says, as it says it: keys carry units, degrees are WGS84, nanoseconds count from 1970. */
import type { Feature, FeatureCollection, LineString, Point, Polygon } from "geojson";

/** Longitude and latitude in degrees. */
export type LonLat = [number, number];

/** A box in degrees: west, south, east, north. */
export type Box = [number, number, number, number];

export interface VersionSummary {
  map_version: number;
  solved_ns: number;
  method: string;
  landmark_count: number;
  anchor_count: number;
}

export interface Versions {
  map_version: number | null;
  solved_ns: number | null;
  versions: number[];
  history?: VersionSummary[];
}

export interface Collection {
  storageCrs: string;
  extent: { spatial?: { bbox: Box[] } };
}

export interface LandmarkProperties {
  landmark: string;
  kind: string;
  signature: string;
  easting_m: number;
  northing_m: number;
  covariance_m2: [[number, number], [number, number]];
  sigma_major_m: number;
  sigma_minor_m: number;
  ellipse_heading_rad: number;
  observation_count: number;
  vehicles: string[];
  first_seen_ns: number;
  last_seen_ns: number;
  anchored: boolean;
  anchors: string[];
  valid_from_version: number;
  valid_to_version: number | null;
}

export interface AnchorProperties {
  anchor: string;
  image: string;
  kind: string;
  landmark: string;
  reason: string;
  sigma_m: number | null;
  residual_x_m: number | null;
  residual_y_m: number | null;
  residual_m: number | null;
  map_version: number;
}

export interface FixProperties {
  vehicle: string;
  boot_id: string;
  stamp_ns: number;
  accepted: boolean;
  reason: string;
  nis: number | null;
  limit: number | null;
  sigma_m: number | null;
  innovation_x_m: number | null;
  innovation_y_m: number | null;
}

export interface PathProperties {
  vehicle: string;
  boot_id: string;
  pose_count: number;
  length_m: number;
}

export type LandmarkFeature = Feature<Point, LandmarkProperties>;
export type AnchorFeature = Feature<Point | null, AnchorProperties>;
export type FixFeature = Feature<Point, FixProperties>;
export type PathFeature = Feature<LineString, PathProperties>;

/** A page of features; `next` is among the links where there are more. */
export interface Page<F> {
  map_version: number | null;
  features: F[];
  numberMatched?: number;
  numberReturned?: number;
  links?: { rel: string; href: string }[];
}

export type Fixes = FeatureCollection<Point, FixProperties> & { numberMatched: number };
export type Paths = FeatureCollection<LineString, PathProperties>;

export interface AerialImage {
  image: string;
  footprint: Polygon | null;
  footprint_source: string;
  offset_x_m: number | null;
  offset_y_m: number | null;
  sigma_major_m: number | null;
  anchor_count: number;
}

export interface Candidate {
  landmark: string;
  distance_m: number;
  position: LonLat;
  kind: string;
}

export interface Association {
  map_version: number | null;
  landmark: string;
  reason: string;
  distance_m: number | null;
  gate_m: number | null;
  corrected_distance_m: number | null;
  landmark_position: LonLat | null;
  landmark_kind: string | null;
  runner_up: Candidate | null;
  already_anchored_by: string[];
  expected_variance_reduction_m2: number | null;
  explanation: string;
}

export interface Suggestion {
  rank: number;
  landmark: string;
  kind: string;
  position: LonLat;
  sigma_major_m: number;
  variance_reduction_m2: number;
  /** Of the map's summed variance, where that is known. */
  share: number | null;
  image: string;
  image_choices: string[];
}

export interface Suggestions {
  map_version: number | null;
  summed_variance_m2: number | null;
  suggestions: Suggestion[];
  method: string;
}

export interface Raster {
  name: string;
  title: string;
  kind: string;
  tiles: string[];
  bounds: Box;
  minzoom: number;
  maxzoom: number;
  tile_size: number;
  attribution: string;
}

/** An image whose shift against the ortho layer was measured. */
export interface RegisteredImage {
  image: string;
  tiles: string;
}

/** A tile's shift: where the image shows the ground, less where the layer has it; null of a refused one. */
export interface ShiftProperties {
  image: string;
  map_version: number | null;
  shift_east_m: number | null;
  shift_north_m: number | null;
  sigma_east_m: number | null;
  sigma_north_m: number | null;
  length_m: number | null;
  shown_lon_deg: number | null;
  shown_lat_deg: number | null;
  confidence: number;
  refused: string | null;
}

export type ShiftFeature = Feature<Point, ShiftProperties>;
export type Shifts = FeatureCollection<Point, ShiftProperties>;

export interface Access {
  name: string;
  scope: string | null;
  can_read: boolean;
  can_label: boolean;
  why_not_label: string;
}

export interface LabelInForce {
  anchor: string;
  image: string;
  position: LonLat;
  sigma_m: number;
}

export interface NewLabel {
  anchor: string;
  image: string;
  lat_deg: number;
  lon_deg: number;
  sigma_m: number;
  image_sigma_m: number;
  kind: string;
}

export interface Told {
  map_version: number | null;
  solved_ns: number | null;
  now_ns: number;
  database_reached: boolean;
}
