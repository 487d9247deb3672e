/** The page: connects with the service it came from, and shows its map. */
import "./theme.css";
import { MapApi, Refused, said } from "./api.ts";
import { el, fill } from "./dom.ts";
import { Follower } from "./live/follower.ts";
import { MapView } from "./map/mapView.ts";
import { statusBar } from "./panels/statusBar.ts";
import { tokenForm } from "./panels/tokenForm.ts";
import { Speech } from "./speech.ts";
import { BEGINNING, Store } from "./state.ts";
import { frame, Viewer } from "./viewer.ts";

const WORLD: [number, number, number, number] = [-170, -60, 170, 70];

const api = new MapApi(new URL("../", document.baseURI).href);
const store = new Store(BEGINNING);
const speech = new Speech();
const token = tokenForm(store, () => void begin());
const title = el("h1", {}, "trigpoint", el("small", {}, "viewer"));
const root = document.getElementById("viewer") ?? document.body;
const places = frame(root, [title, statusBar(store, speech), speech.element]);
let viewer: Viewer | null = null;
let beginning = false;

async function learnAccess(): Promise<boolean> {
  try {
    store.set({ access: await api.access() });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    if (error.status === 401 || error.status === 403) {
      const nothing = { name: "anyone", scope: null, can_read: false, can_label: false, why_not_label: error.message };
      store.set({ access: nothing });
    }
  }
  return store.state.access?.can_read !== false;
}

async function open(): Promise<void> {
  if (!(await learnAccess())) {
    fill(places.panel, token);
    return;
  }
  if (viewer) return viewer.refresh();
  const [versions, landmarks] = await Promise.all([api.versions(), api.collection("landmarks")]);
  const version = versions.map_version;
  if (version === null) {
    fill(places.panel, el("p", { class: "empty" }, "The map has no version yet. It is shown here as soon as it has."));
    return;
  }
  store.set({ versions, shown: version, crs: landmarks.storageCrs, trouble: "" });
  const box = landmarks.extent.spatial?.bbox[0] ?? WORLD;
  const view = new MapView(places.canvas, api, box, version);
  viewer = new Viewer(api, store, view, speech, places, token);
  const begun = viewer.begin();
  await view.drawn;
  performance.mark("first-picture");
  places.canvas.dataset.drawn = "true";
  await begun;
  await viewer.offerRasters();
  await viewer.offerShifts();
}

/** Shows the map if it can be; asked again at every sign of life until it can. */
async function begin(): Promise<void> {
  if (beginning) return;
  beginning = true;
  try {
    await open();
  } catch (error) {
    store.set({ trouble: said(error) });
  } finally {
    beginning = false;
  }
}

const follower = new Follower(api, (link) => {
  store.set({ link });
  if (!viewer && link.way !== "offline") void begin();
});
void begin();
void follower.run();
