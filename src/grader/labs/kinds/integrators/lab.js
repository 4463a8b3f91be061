// One scene under all five integrators from one state: how far the energy drifts, and what a step costs.

import { drawChart } from "../chart.js";
import { el, number } from "../dom.js";
import { Newest } from "../newest.js";
import { DIVERGED } from "../strips.js";

const SMALLEST = 1e-9; // % of the energy: below it there is nothing but rounding
const LARGEST = 1e4;

export function open(box, { run: ask, tell }) {
  const [model, key, timestep] = ["model", "key", "timestep"].map((name) => box.querySelector(`[data-${name}]`));
  const picture = box.querySelector(".strips");
  let shownModel = null, answer = null;

  function offerKeys({ model: name, keys, key: chosen }) {
    if (name === shownModel) return;
    shownModel = name;
    key.replaceChildren(el("option", { value: "" }, "the model's own"), ...keys.map((one) => el("option", {}, one)));
    key.value = chosen ?? "";
  }

  function show(run) {
    answer = run;
    offerKeys(run);
    tell(`${number(run.seconds)} s at a timestep of ${number(1000 * run.timestep)} ms, from one state. The cost is this server's and differs from run to run.`);
    draw();
    for (const one of run.integrators) fillRow(box.querySelector(`[data-integrator=${one.name}]`), one);
  }

  const draw = () => { if (answer) drawChart(picture, { end: answer.seconds, strips: [stripOf(answer.integrators)] }); };
  const runs = new Newest(() => {
    const chosen = model.value === shownModel ? { key: key.value } : {};
    return ask({ model: model.value, ...chosen, timestep: Number((timestep.valueAsNumber / 1000).toPrecision(12)) });
  }, show, (error) => tell(error.message, true));

  for (const input of [model, key, timestep]) {
    input.disabled = false;
    input.addEventListener("change", () => {
      const isValue = timestep.validity.valid && timestep.value !== "";
      timestep.setAttribute("aria-invalid", String(!isValue));
      if (isValue) return runs.want({});
      tell("The timestep must be a number from 0.1 to 100 ms.", true);
    });
  }
  new ResizeObserver(draw).observe(picture);
  runs.want({});
}

// The size of the error on a logarithmic axis: explicit and implicit methods lie many decades apart.
function stripOf(runs) {
  const sizes = runs.map((run) => run.energy_error_percent.map((value, i) => (value === null || run.times[i] > resetOf(run) ? null : Math.abs(value))));
  return {
    label: "size of the energy error (%)",
    weight: 1,
    axis: { log: true },
    shows: sizes.flat().filter((value) => value !== null && value >= SMALLEST && value <= LARGEST),
    lines: [],
    ghost: [],
    series: runs.map((run, index) => ({ label: run.name, className: run.name, times: run.times, values: sizes[index].map((value) => (value === 0 ? null : value)) })),
  };
}

// When MuJoCo reset a run that had diverged: from there on it is another run.
const resetOf = ({ warnings }) => warnings.find(({ kind }) => DIVERGED.test(kind))?.time ?? Infinity;

function fillRow(row, run) {
  const signed = (value) => (value === null ? "no number" : (value > 0 ? "+" : value < 0 ? "−" : "") + number(Math.abs(value)));
  const [first] = run.warnings;
  const texts = [resetOf(run) < Infinity ? "was reset" : signed(run.final_error_percent), run.cost_us_per_step.toFixed(2), first ? `${first.kind} at ${number(first.time)} s` : "none"];
  row.querySelectorAll("td").forEach((cell, index) => { cell.textContent = texts[index]; });
}
