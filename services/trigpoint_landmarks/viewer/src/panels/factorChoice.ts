/** Choices of how many times as large something is drawn as it is. */
import { el, options } from "../dom.ts";
import type { Store } from "../state.ts";

const FITTED = "fitted";
const ARROW_FACTORS = [1, 5, 20, 50, 100];

function named(factor: number): readonly [string, string] {
  return [String(factor), factor === 1 ? "× 1, true to scale" : `× ${factor}`];
}

function choice(label: string, id: string): { element: HTMLElement; select: HTMLSelectElement } {
  const select = el("select", { id });
  return { select, element: el("div", { class: "choice" }, el("label", { for: id }, label), select) };
}

/** A choice of factors. */
export function factorChoice(
  label: string,
  factors: readonly number[],
  chosen: number,
  choose: (factor: number) => void,
): HTMLElement {
  const { element, select } = choice(label, `factor-${label.toLowerCase().replaceAll(" ", "-")}`);
  options(select, factors.map(named));
  select.value = String(chosen);
  select.addEventListener("change", () => choose(Number(select.value)));
  return element;
}

/** The arrows' choice: a factor, or the one that suits the view, which it says. */
export function arrowChoice(store: Store): HTMLElement {
  const { element, select } = choice("Arrows drawn", "factor-arrows");
  select.addEventListener("change", () => {
    const arrowsFitted = select.value === FITTED;
    store.set(arrowsFitted ? { arrowsFitted } : { arrowsFitted, arrowFactor: Number(select.value) });
  });
  store.on(["arrowFactor", "arrowsFitted"], ({ arrowFactor, arrowsFitted }) => {
    options(select, [[FITTED, `fitted: × ${arrowFactor}`], ...ARROW_FACTORS.map(named)]);
    select.value = arrowsFitted ? FITTED : String(arrowFactor);
  });
  return element;
}
