/** How the page is connected with the map, in words and a colour. */
import { el, fill } from "../dom.ts";
import { spoken } from "../live/link.ts";
import type { Speech } from "../speech.ts";
import type { Store } from "../state.ts";

const TICK_MS = 1000;

export function statusBar(store: Store, speech: Speech): HTMLElement {
  const title = el("strong", {});
  const detail = el("span", { class: "muted" });
  const trouble = el("p", { class: "trouble", role: "alert" });
  const pill = el("p", { class: "status" }, el("i", { "aria-hidden": "true" }), el("span", {}, title, " ", detail));
  let toldTitle = "";
  const show = () => {
    const words = spoken(store.state.link, Date.now());
    pill.dataset.tone = words.tone;
    if (title.textContent !== words.title) title.textContent = words.title;
    if (detail.textContent !== words.detail) detail.textContent = words.detail;
    if (toldTitle && toldTitle !== words.title) speech.say(`${words.title}: ${words.detail}`);
    toldTitle = words.title;
  };
  store.on(["link"], show);
  store.on(["trouble"], (state) => fill(trouble, state.trouble));
  setInterval(show, TICK_MS);
  return el("div", {}, pill, trouble);
}
