/** What is said aloud by screen readers, and for a while shown. */
import { el } from "./dom.ts";

export class Speech {
  readonly element = el("div", { class: "speech", role: "status", "aria-live": "polite" });

  say(text: string): void {
    this.element.textContent = text;
  }
}
