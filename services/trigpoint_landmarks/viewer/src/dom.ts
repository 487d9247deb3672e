/** Elements made by hand: what is said is always text, never markup. */

export type Child = Node | string | null | undefined | false;
type Handlers = Partial<{ [K in keyof HTMLElementEventMap as `on${K}`]: (event: HTMLElementEventMap[K]) => void }>;
type Attributes = Record<string, unknown>;

function setOne(made: HTMLElement, name: string, value: unknown): void {
  if (value === undefined || value === null || value === false) return;
  if (name.startsWith("on") && typeof value === "function") {
    made.addEventListener(name.slice(2), value as EventListener);
  } else {
    made.setAttribute(name, value === true ? "" : String(value));
  }
}

/** An element with attributes, handlers and children. */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes & Handlers = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) setOne(made, name, value);
  fill(made, ...children);
  return made;
}

/** The element with these children and no others. */
export function fill(parent: Element, ...children: Child[]): void {
  const there = children.filter((child): child is Node | string => Boolean(child));
  parent.replaceChildren(...there);
}

/** A button. */
export function button(
  text: string,
  onclick: (event: MouseEvent) => void,
  attributes: Attributes = {},
): HTMLButtonElement {
  return el("button", { type: "button", onclick, ...attributes }, text);
}

/** A labelled control. */
export function field(label: string, control: HTMLElement, hint?: string): HTMLElement {
  const id = control.id || `field-${label.toLowerCase().replaceAll(/[^a-z]+/g, "-")}`;
  control.id = id;
  if (hint) control.setAttribute("aria-describedby", `${id}-hint`);
  return el(
    "div",
    { class: "field" },
    el("label", { for: id }, label),
    control,
    hint ? el("p", { class: "hint", id: `${id}-hint` }, hint) : null,
  );
}

/** Facts: a term and what it is, row by row; what is null is left out. */
export function facts(rows: readonly (readonly [string, Child])[]): HTMLElement {
  const shown = rows.filter(([, value]) => value !== null && value !== undefined && value !== false);
  return el("dl", { class: "facts" }, ...shown.flatMap(([term, value]) => [el("dt", {}, term), el("dd", {}, value)]));
}

/** An option list with one chosen. */
export function options(select: HTMLSelectElement, choices: readonly (readonly [string, string])[]): void {
  const chosen = select.value;
  select.replaceChildren(...choices.map(([value, text]) => el("option", { value }, text)));
  if (choices.some(([value]) => value === chosen)) select.value = chosen;
}
