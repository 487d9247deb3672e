/** What the page knows, and who is told when it changes. */
import { type Link, UNLINKED } from "./live/link.ts";
import type {
  Access,
  AerialImage,
  AnchorFeature,
  FixFeature,
  LonLat,
  ShiftFeature,
  Suggestions,
  Versions,
} from "./wire.ts";

/** What is looked at more closely. */
export type Selection =
  | { what: "landmark"; id: string }
  | { what: "anchor"; id: string }
  | { what: "fix"; id: string }
  | { what: "image"; id: string }
  | { what: "shift"; id: string };

export interface ViewerState {
  link: Link;
  versions: Versions | null;
  /** The map version that is shown; null before the first. */
  shown: number | null;
  following: boolean;
  access: Access | null;
  crs: string;
  anchors: readonly AnchorFeature[];
  images: readonly AerialImage[];
  fixes: readonly FixFeature[];
  /** The tiles of registered images that are shown. */
  shifts: readonly ShiftFeature[];
  suggestions: Suggestions | null;
  selection: Selection | null;
  /** Where the selected thing is. */
  selectedAt: LonLat | null;
  /** How many times as long as they are arrows are drawn, and as large ellipses. */
  arrowFactor: number;
  /** Whether the arrows' factor goes with the view. */
  arrowsFitted: boolean;
  ellipseFactor: number;
  /** What went wrong last in getting what is shown; "" for nothing. */
  trouble: string;
}

export const BEGINNING: ViewerState = {
  link: UNLINKED,
  versions: null,
  shown: null,
  following: true,
  access: null,
  crs: "",
  anchors: [],
  images: [],
  fixes: [],
  shifts: [],
  suggestions: null,
  selection: null,
  selectedAt: null,
  arrowFactor: 20,
  arrowsFitted: true,
  ellipseFactor: 1,
  trouble: "",
};

type Listener = (state: ViewerState) => void;

export class Store {
  private listeners: [readonly (keyof ViewerState)[], Listener][] = [];

  constructor(private current: ViewerState) {}

  get state(): ViewerState {
    return this.current;
  }

  /** Changes some of the state; whoever listens to any of what is different now is told, once. */
  set(changed: Partial<ViewerState>): void {
    const before = this.current;
    this.current = { ...before, ...changed };
    for (const [keys, listener] of this.listeners) {
      if (keys.some((key) => before[key] !== this.current[key])) listener(this.current);
    }
  }

  /** Tells now, and whenever one of the keys changes. */
  on(keys: readonly (keyof ViewerState)[], listener: Listener): void {
    this.listeners.push([keys, listener]);
    listener(this.current);
  }
}
