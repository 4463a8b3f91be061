// A button beside what is there to be copied; without this it is selected by hand.

import { el } from "./dom.js";

export function offerCopies(root) {
  root.querySelectorAll("[data-copy]").forEach(offerCopy);
}

function offerCopy(field) {
  field.addEventListener("focus", () => field.select());
  const button = el("button", { type: "button", class: "quiet small", onclick: copy }, "Copy");
  field.closest("label").after(el("p", { class: "actions" }, button));

  async function copy() {
    await navigator.clipboard.writeText(field.value);
    button.textContent = "Copied";
  }
}

offerCopies(document);
