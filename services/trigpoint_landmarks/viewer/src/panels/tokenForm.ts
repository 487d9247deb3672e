/** A token, entered here and kept in this tab only. */
import { button, el, fill } from "../dom.ts";
import type { Store } from "../state.ts";
import { keepToken, keptToken } from "../token.ts";

/** The form, shown where something cannot be done without a token, or one was entered. */
export function tokenForm(store: Store, changed: () => void): HTMLElement {
  const secret = el("input", {
    type: "password",
    id: "token",
    autocomplete: "off",
    spellcheck: "false",
    required: true,
  });
  const why = el("p", {});
  const enter = el(
    "form",
    {
      onsubmit: (event: SubmitEvent) => {
        event.preventDefault();
        keepToken(secret.value.trim());
        secret.value = "";
        changed();
      },
    },
    el("label", { for: "token" }, "Token"),
    el("div", { class: "joined" }, secret, el("button", {}, "Use it")),
    el("p", { class: "hint" }, "Kept in this browser tab until it is closed."),
  );
  const forget = button("Forget the token", () => {
    keepToken("");
    changed();
  });
  const form = el("section", { class: "card token", "aria-label": "Token" });
  store.on(["access"], ({ access }) => {
    form.hidden = access === null || (access.can_label && !keptToken());
    form.classList.toggle("entered", access?.can_label === true);
    why.textContent = access?.can_label ? `Labelling as ${access.name}.` : (access?.why_not_label ?? "");
    fill(form, why, access?.can_label ? null : enter, keptToken() ? forget : null);
  });
  return form;
}
