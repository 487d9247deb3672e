/** Which map version is shown: a slider over all of them, and whether to go along with the newest. */
import { button, el } from "../dom.ts";
import type { Store, ViewerState } from "../state.ts";
import { counted } from "../text.ts";

const SETTLED_MS = 120; // a slider that is dragged passes many versions

function described({ versions, shown }: ViewerState): string {
  const summary = versions?.history?.find((one) => one.map_version === shown);
  if (!summary) return "";
  const { method, landmark_count: landmarks, anchor_count: anchors } = summary;
  return `${method}, ${counted(landmarks, "landmark")}, ${counted(anchors, "anchor")}`;
}

function shownText({ versions, shown, link }: ViewerState): string {
  const newest = link.newest ?? versions?.map_version;
  if (shown === null) return "No map version yet";
  return shown === newest ? `Version ${shown}, the newest` : `Version ${shown} of ${newest}`;
}

export class VersionBar {
  readonly element: HTMLElement;
  private readonly slider = el("input", { type: "range", min: "0", step: "1", "aria-label": "Map version" });
  private readonly title = el("strong", {});
  private readonly about = el("span", { class: "muted" });
  private timer = 0;

  constructor(
    private readonly store: Store,
    private readonly showVersion: (version: number, following: boolean) => void,
  ) {
    this.slider.addEventListener("input", () => this.slid());
    const follow = el("input", { type: "checkbox", role: "switch", id: "follow" });
    follow.addEventListener("change", () => this.follow(follow.checked));
    const older = button("‹", () => this.step(-1), { "aria-label": "Older version", class: "icon" });
    const newer = button("›", () => this.step(1), { "aria-label": "Newer version", class: "icon" });
    const head = el("div", { class: "version-head" }, el("p", {}, this.title, " ", this.about));
    this.element = el(
      "section",
      { class: "versions", "aria-label": "Map versions" },
      head,
      el(
        "div",
        { class: "version-row" },
        older,
        this.slider,
        newer,
        el("label", { class: "switch" }, follow, "Follow live"),
      ),
    );
    store.on(["versions", "shown", "following", "link"], (state) => {
      this.render(state);
      follow.checked = state.following;
      older.disabled = this.slider.value === this.slider.min;
      newer.disabled = this.slider.value === this.slider.max;
    });
  }

  private get numbers(): number[] {
    return this.store.state.versions?.versions ?? [];
  }

  private render(state: ViewerState): void {
    const numbers = this.numbers;
    this.slider.max = String(Math.max(0, numbers.length - 1));
    this.slider.disabled = numbers.length < 2;
    this.slider.value = String(Math.max(0, numbers.indexOf(state.shown ?? -1)));
    this.title.textContent = shownText(state);
    this.about.textContent = described(state);
    this.slider.setAttribute("aria-valuetext", `${shownText(state)}. ${described(state)}`);
  }

  private slid(): void {
    clearTimeout(this.timer);
    const wanted = this.numbers[Number(this.slider.value)];
    this.timer = setTimeout(() => wanted !== undefined && this.showVersion(wanted, false), SETTLED_MS);
  }

  private step(by: number): void {
    const wanted = this.numbers[Number(this.slider.value) + by];
    if (wanted !== undefined) this.showVersion(wanted, false);
  }

  private follow(following: boolean): void {
    const newest = this.numbers.at(-1);
    if (newest === undefined) return;
    this.showVersion(following ? newest : (this.store.state.shown ?? newest), following);
  }
}
