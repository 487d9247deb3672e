/** The service asked: one method a resource, refusals as `Refused`. */
import { tokenHeaders } from "./token.ts";
import type {
  Access,
  AerialImage,
  AnchorFeature,
  Association,
  Box,
  Collection,
  Fixes,
  LabelInForce,
  LandmarkFeature,
  LonLat,
  NewLabel,
  Page,
  PathFeature,
  Paths,
  Raster,
  RegisteredImage,
  Shifts,
  Suggestions,
  Versions,
} from "./wire.ts";

const PAGE_MOST = 1000;
const FEATURES_MOST = 10_000;

/** The service answered, and said no; `status` 0: nobody answered. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    detail: string,
  ) {
    super(detail);
  }
}

/** What to tell people of an error. */
export function said(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

type Parameters = Record<string, string | number | boolean | null | undefined>;

async function refusal(answer: Response): Promise<Refused> {
  const text = await answer.text();
  try {
    const problem = JSON.parse(text) as { detail?: string; title?: string };
    return new Refused(answer.status, problem.detail || problem.title || answer.statusText);
  } catch {
    return new Refused(answer.status, `the service answered ${answer.status}`);
  }
}

/** The label association is asked for. */
export interface Prospect {
  position: LonLat;
  sigma_m: number;
  image_sigma_m: number;
  image: string;
  kind: string;
}

export class MapApi {
  /** `base`: the service's own address, with a slash at its end. */
  constructor(readonly base: string) {}

  url(path: string, parameters: Parameters = {}): string {
    const url = new URL(path, this.base);
    for (const [name, value] of Object.entries(parameters)) {
      if (value !== null && value !== undefined) url.searchParams.set(name, String(value));
    }
    return url.href;
  }

  /** The template of a layer's tiles in a version. */
  tiles(layer: string, version: number): string {
    return `${this.base}v/${version}/tiles/${layer}/{z}/{x}/{y}`;
  }

  async answer(url: string, init: RequestInit = {}): Promise<Response> {
    let answer: Response;
    try {
      answer = await fetch(url, { ...init, headers: { ...tokenHeaders(), ...init.headers } });
    } catch (error) {
      if (init.signal?.aborted) throw error;
      throw new Refused(0, "the service does not answer");
    }
    if (!answer.ok) throw await refusal(answer);
    return answer;
  }

  async told<T>(path: string, parameters: Parameters = {}, signal?: AbortSignal): Promise<T> {
    const init = signal ? { signal } : {};
    return (await (await this.answer(this.url(path, parameters), init)).json()) as T;
  }

  versions(): Promise<Versions> {
    return this.told("versions");
  }

  collection(name: string): Promise<Collection> {
    return this.told(`collections/${name}`);
  }

  access(): Promise<Access> {
    return this.told("access");
  }

  landmark(id: string, asOf: number | null): Promise<LandmarkFeature> {
    return this.told(`collections/landmarks/items/${encodeURIComponent(id)}`, { as_of: asOf });
  }

  landmarksIn(box: Box, asOf: number | null, limit: number): Promise<Page<LandmarkFeature>> {
    return this.told("collections/landmarks/items", { bbox: box.join(","), as_of: asOf, limit });
  }

  anchors(asOf: number | null): Promise<AnchorFeature[]> {
    return this.everything<AnchorFeature>("anchors", asOf);
  }

  trajectories(asOf: number | null): Promise<PathFeature[]> {
    return this.everything<PathFeature>("trajectories", asOf);
  }

  paths(source: string): Promise<Paths> {
    return this.told("paths", { source });
  }

  rejectedFixes(): Promise<Fixes> {
    return this.told("fixes", { accepted: false });
  }

  async images(asOf: number | null): Promise<AerialImage[]> {
    return (await this.told<{ images: AerialImage[] }>("images", { as_of: asOf })).images;
  }

  async rasters(): Promise<Raster[]> {
    return (await this.told<{ rasters: Raster[] }>("rasters")).rasters;
  }

  async registeredImages(): Promise<RegisteredImage[]> {
    return (await this.told<{ shifts: RegisteredImage[] }>("shifts")).shifts;
  }

  shifts(image: string): Promise<Shifts> {
    return this.told(`shifts/${encodeURIComponent(image)}`);
  }

  async labels(): Promise<LabelInForce[]> {
    return (await this.told<{ labels: LabelInForce[] }>("labels")).labels;
  }

  association(prospect: Prospect, asOf: number | null, signal: AbortSignal): Promise<Association> {
    const { position, ...label } = prospect;
    const parameters = { lat_deg: position[1], lon_deg: position[0], ...label, as_of: asOf };
    return this.told("association", parameters, signal);
  }

  suggestions(asOf: number | null): Promise<Suggestions> {
    return this.told("anchor-suggestions", { as_of: asOf, limit: 20 });
  }

  async label(label: NewLabel): Promise<void> {
    const headers = { "Content-Type": "application/json" };
    await this.answer(this.url("anchors"), { method: "POST", headers, body: JSON.stringify(label) });
  }

  async retract(anchor: string, image: string, reason: string): Promise<void> {
    const path = `anchors/${encodeURIComponent(anchor)}`;
    await this.answer(this.url(path, { image, reason }), { method: "DELETE" });
  }

  /** Every feature of a collection, page by page. */
  private async everything<F>(collection: string, asOf: number | null): Promise<F[]> {
    const found: F[] = [];
    let first: string | null = null;
    do {
      const parameters: Parameters = { as_of: asOf, limit: PAGE_MOST, from: first };
      const page: Page<F> = await this.told(`collections/${collection}/items`, parameters);
      found.push(...page.features);
      const next = page.links?.find((link) => link.rel === "next");
      first = next ? new URL(next.href).searchParams.get("from") : null;
    } while (first !== null && found.length < FEATURES_MOST);
    return found;
  }
}
