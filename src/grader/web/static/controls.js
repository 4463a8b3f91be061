// A lab's controls on the page: sliders with typed values, selects and buttons. Values are keyed by label.

import { el, limitText, number, seconds } from "./dom.js";
import { decades } from "./scale.js";

const LOG_RATIO = 100; // as in lab_box.py, which draws the first position
const FIGURES = 3;

export class Controls {
  // listeners: begin() before the first change of a gesture, change(spec) after each change, press(label) for a button.
  constructor(box, specs, listeners) {
    this.specs = specs;
    this.listeners = listeners;
    this.values = {};
    this.ticks = new Map();
    box.querySelectorAll("[data-control]").forEach((node, index) => {
      const spec = specs[index];
      if (spec.type === "button") node.addEventListener("click", () => listeners.press(spec.label));
      else if (spec.type === "select") this.select(node.querySelector("select"), spec);
      else this.slider(node, spec);
      for (const input of [node, ...node.querySelectorAll("input, select")]) input.disabled = false;
    });
  }

  slider(node, spec) {
    const typed = node.querySelector("input[type=number]"), range = node.querySelector("input[type=range]");
    const line = lineOf(spec), hasLimit = node.classList.contains("has-limit");
    const shown = (value) => range.setAttribute("aria-valuetext", written(value, spec));
    const set = (value) => {
      if (!this.moving) this.listeners.begin();
      this.moving = true;
      this.values[spec.label] = value;
      shown(value);
      this.listeners.change(spec);
    };
    // Rounded down: were the steps a bit larger, the last one would lie beyond the end, and be left out.
    range.step = spec.step && !line.isLog ? Math.floor(1e12 * spec.step / (spec.max - spec.min)) / 1e12 : "any";
    range.addEventListener("input", () => {
      const value = onGrid(line.value(Number(range.value)), spec);
      typed.value = value;
      set(value);
    });
    typed.addEventListener("change", () => {
      const isValue = typed.value !== "" && typed.validity.valid;
      typed.toggleAttribute("aria-invalid", false);
      if (!isValue) {
        typed.setAttribute("aria-invalid", "true");
        this.listeners.refuse(`${spec.label} must be a number from ${number(spec.min)} to ${number(spec.max)}${spec.unit ? ` ${spec.unit}` : ""}.`);
        return;
      }
      const value = onGrid(typed.valueAsNumber, spec);
      typed.value = value;
      range.value = line.place(value);
      set(value);
      this.moving = false;
    });
    range.addEventListener("change", () => { this.moving = false; });
    shown(spec.value);
    const ticks = node.querySelector(".ticks");
    ticks.append(...line.marks.map((value) => tick(line.place(value), hasLimit ? seconds(value) : number(value))));
    this.ticks.set(spec.label, { ticks, line });
  }

  // The page may begin with another choice than the author's: that of the learner's prediction.
  select(input, spec) {
    if (input.value !== this.textOf(spec, { [spec.label]: spec.value })) this.values[spec.label] = input.value;
    input.addEventListener("change", () => {
      this.listeners.begin();
      this.values[spec.label] = input.value;
      this.listeners.change(spec);
    });
  }

  // A tick at the stability limit [s] on the slider of the timestep; beyond it, hatched, small motions grow.
  mark(run, className) {
    const { limit } = run;
    for (const { ticks } of this.ticks.values()) ticks.querySelectorAll(".limit, .beyond").forEach((node) => node.remove());
    const place = limit && this.ticks.get(limit.control);
    if (!place || limit.timestep_s === null) return;
    const at = place.line.place(limit.timestep_s);
    const beyond = el("u", { class: `beyond ${className}` });
    beyond.style.left = `${100 * at}%`;
    place.ticks.append(beyond, tick(at, `limit ${limitText(limit, run)}`, `limit ${className}`));
  }

  // What the controls of a run were, as far as they differ from those of another run.
  difference(run, other) {
    return this.specs.filter(({ label }) => label in run && String(run[label]) !== String(other[label]))
      .map((spec) => (spec.type === "select" ? this.textOf(spec, run) : `${spec.label} ${written(run[spec.label], spec)}`)).join(", ");
  }

  textOf(spec, run) {
    return spec.options.find(([, value]) => String(value) === String(run[spec.label]))?.[0] ?? "";
  }

  // The texts of all options that a run was made with.
  choices(run) {
    return this.specs.filter(({ type }) => type === "select").map((spec) => this.textOf(spec, run));
  }
}

function lineOf({ min, max }) {
  const isLog = min > 0 && max / min >= LOG_RATIO;
  const turn = isLog ? Math.log : (value) => value, back = isLog ? Math.exp : (value) => value;
  const marks = isLog ? decades(Math.log10(min), Math.log10(max), 4) : [min, max];
  return {
    isLog, marks,
    place: (value) => (turn(value) - turn(min)) / (turn(max) - turn(min)),
    value: (place) => back(turn(min) + place * (turn(max) - turn(min))),
  };
}

function tick(at, text, className = "") {
  const node = el("span", { class: className }, el("i"), el("b", {}, text));
  node.style.left = `${100 * at}%`;
  node.style.setProperty("--shift", `${-100 * Math.min(1, Math.max(0, at))}%`);
  return node;
}

// Rounds to the step, or to figures where there is none: the browser's own values carry rounding errors.
function onGrid(value, { min, max, step }) {
  const rounded = step ? min + Math.round((value - min) / step) * step : Number(value.toPrecision(FIGURES + 1));
  return Math.min(max, Math.max(min, Number(rounded.toPrecision(12))));
}

const written = (value, { digits, unit }) => `${digits === null || digits === undefined ? number(value) : value.toFixed(digits).replace("-", "−")}${unit ? ` ${unit}` : ""}`;
