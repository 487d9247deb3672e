/** Tabs as the ARIA practices have them: arrows move between tabs, Tab goes into the panel. */
import { el } from "../dom.ts";

export interface Tab {
  id: string;
  title: string;
  content: HTMLElement;
  shown?: () => void;
}

export class Tabs {
  readonly list: HTMLElement;
  readonly panels: HTMLElement;
  private readonly handles: HTMLButtonElement[];
  private readonly contents: HTMLElement[];

  constructor(private readonly tabs: readonly Tab[]) {
    this.handles = tabs.map((tab, index) =>
      el(
        "button",
        {
          type: "button",
          role: "tab",
          id: `tab-${tab.id}`,
          "aria-controls": `panel-${tab.id}`,
          onclick: () => this.choose(index),
          onkeydown: (event: KeyboardEvent) => this.move(event, index),
        },
        tab.title,
      ),
    );
    this.contents = tabs.map((tab) =>
      el(
        "div",
        { role: "tabpanel", id: `panel-${tab.id}`, "aria-labelledby": `tab-${tab.id}`, tabindex: "-1" },
        tab.content,
      ),
    );
    this.list = el("div", { role: "tablist", "aria-label": "What to do", class: "tabs" }, ...this.handles);
    this.panels = el("div", { class: "panels" }, ...this.contents);
    this.choose(0);
  }

  open(id: string): void {
    this.choose(this.tabs.findIndex((tab) => tab.id === id));
  }

  isOpen(id: string): boolean {
    return this.contents[this.tabs.findIndex((tab) => tab.id === id)]?.hidden === false;
  }

  private choose(chosen: number): void {
    this.handles.forEach((handle, index) => {
      handle.setAttribute("aria-selected", String(index === chosen));
      handle.tabIndex = index === chosen ? 0 : -1;
    });
    this.contents.forEach((panel, index) => {
      panel.hidden = index !== chosen;
    });
    this.tabs[chosen]?.shown?.();
  }

  private move(event: KeyboardEvent, index: number): void {
    const last = this.tabs.length - 1;
    const steps: Record<string, number> = { ArrowRight: index + 1, ArrowLeft: index - 1, Home: 0, End: last };
    const wanted = steps[event.key];
    if (wanted === undefined) return;
    event.preventDefault();
    const next = wanted < 0 ? last : wanted > last ? 0 : wanted;
    this.choose(next);
    this.handles[next]?.focus();
  }
}
