/** Where one more anchor would help most: a list that can be stepped through, and the same on the map. */
import { button, el, fill } from "../dom.ts";
import type { MapView } from "../map/mapView.ts";
import type { Speech } from "../speech.ts";
import type { Store } from "../state.ts";
import { metres, percent, squareMetres } from "../text.ts";
import type { Suggestion, Suggestions } from "../wire.ts";

function shareOf({ share }: Suggestion): string {
  return share === null ? "of an unknown whole" : `${percent(share)} of the map's variance`;
}

export class NextPanel {
  readonly element: HTMLElement;
  private readonly list = el("ol", { class: "ranked" });
  private readonly about = el("p", { class: "muted" });
  private readonly method = el("p", { class: "muted" });
  private readonly how = el("details", {}, el("summary", {}, "How this is worked out"), this.method);
  private readonly stepper: HTMLElement;
  /** The landmark that is looked at, whatever its rank has become. */
  private chosen = "";

  constructor(
    private readonly store: Store,
    private readonly view: MapView,
    private readonly speech: Speech,
    private readonly labelHere: (suggestion: Suggestion) => void,
  ) {
    this.stepper = el(
      "div",
      { class: "actions" },
      button("Previous", () => this.step(-1)),
      button("Next", () => this.step(1), { class: "primary" }),
    );
    this.element = el("div", {}, el("h2", {}, "Where to label next"), this.about, this.stepper, this.list, this.how);
    store.on(["suggestions"], ({ suggestions }) => this.render(suggestions));
  }

  private render(found: Suggestions | null): void {
    const rows = found?.suggestions ?? [];
    this.stepper.hidden = !rows.length;
    this.about.textContent = found
      ? rows.length
        ? "One more anchor would make the whole map the more certain, the higher its landmark stands here."
        : "No single anchor would make this map more certain."
      : "This service does not say where an anchor would help.";
    this.method.textContent = found?.method ?? "";
    this.how.hidden = !found;
    fill(this.list, ...rows.map((one, index) => this.row(one, index)));
  }

  private row(one: Suggestion, index: number): HTMLElement {
    const chosen = one.landmark === this.chosen;
    const bar = el("span", { class: "bar", "aria-hidden": "true" });
    bar.style.setProperty("--share", String(one.share ?? 0));
    const gain = `takes off ${squareMetres(one.variance_reduction_m2)}, ${shareOf(one)}`;
    const head = button("", () => this.choose(index), { class: "row", "aria-current": chosen ? "true" : null });
    fill(
      head,
      el("b", {}, String(one.rank)),
      el(
        "span",
        {},
        `${one.kind} ${one.landmark}`,
        el("small", {}, `${gain}; 1-sigma now ${metres(one.sigma_major_m)}`),
      ),
      bar,
    );
    return el("li", {}, head, chosen ? button("Label an anchor here", () => this.labelHere(one)) : null);
  }

  private step(by: number): void {
    const rows = this.store.state.suggestions?.suggestions ?? [];
    const at = rows.findIndex((one) => one.landmark === this.chosen);
    const from = at < 0 && by < 0 ? 0 : at; // before the first stands the last
    if (rows.length) this.choose((from + by + rows.length) % rows.length);
  }

  private choose(index: number): void {
    const { suggestions } = this.store.state;
    const one = suggestions?.suggestions[index];
    if (!suggestions || !one) return;
    this.chosen = one.landmark;
    const focused = this.list.contains(document.activeElement);
    this.render(suggestions);
    if (focused) this.list.querySelectorAll<HTMLButtonElement>("button.row")[index]?.focus();
    this.view.goTo(one.position);
    this.store.set({ selection: null, selectedAt: one.position });
    this.speech.say(`${one.rank}: ${one.kind} ${one.landmark}, ${shareOf(one)}`);
  }
}
