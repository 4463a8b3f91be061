// A lab's controls: sliders, selects and buttons, each with its label; values are keyed by label.

import { el, freshId, number } from "./dom.js";

export class Controls {
  // onChange() after a value has changed, onPress(label) for a button.
  constructor(specs, onChange, onPress) {
    this.values = {};
    this.box = el("div", { class: "controls" }, specs.map((spec) => {
      if (spec.type === "button") return el("button", { type: "button", class: "quiet", onclick: () => onPress(spec.label) }, spec.label);
      return spec.type === "select" ? this.select(spec, onChange) : this.slider(spec, onChange);
    }));
  }

  slider(spec, onChange) {
    const id = freshId("control");
    const shown = el("output", { for: id });
    const show = (value) => { shown.textContent = `${written(value, spec.digits)}${spec.unit ? ` ${spec.unit}` : ""}`; };
    const input = el("input", { id, type: "range", min: spec.min, max: spec.max, step: spec.step ?? "any", value: spec.value });
    input.addEventListener("input", () => {
      const value = Math.min(onGrid(Number(input.value), spec), spec.max);
      show(value);
      this.values[spec.label] = value;
      onChange();
    });
    show(spec.value);
    return el("div", { class: "control" }, el("label", { for: id }, spec.label, shown), input);
  }

  // An option is identified by the text of its value, which need not be a number.
  select(spec, onChange) {
    const id = freshId("control");
    const chosen = JSON.stringify(spec.value);
    const options = spec.options.map(([text, value]) => el("option", { value: text, selected: JSON.stringify(value) === chosen }, text));
    const input = el("select", { id }, options);
    input.addEventListener("change", () => { this.values[spec.label] = input.value; onChange(); });
    return el("div", { class: "control" }, el("label", { for: id }, spec.label), input);
  }
}

// Rounds to the step: the browser's own values carry rounding errors.
function onGrid(value, { min, max, step }) {
  if (!step) return Number(value.toPrecision(4)) >= min ? Math.min(Number(value.toPrecision(4)), max) : min;
  return Number((min + Math.round((value - min) / step) * step).toPrecision(12));
}

const written = (value, digits) => (digits === null || digits === undefined ? number(value) : value.toFixed(digits).replace("-", "−"));
