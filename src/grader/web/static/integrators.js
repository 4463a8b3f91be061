// One scene under all five integrators from one state: how far the energy drifts, and what a step costs.

import { post, setProse } from "./api.js";
import { chart } from "./chart.js";
import { el, freshId, number } from "./dom.js";

const SETTLE_MS = 400;

export function openIntegrators(box, target, lab) {
  const models = new Map([[lab.model, lab.model], ...lab.models.map((one) => (Array.isArray(one) ? one : [one, one]))]);
  const model = el("select", { id: freshId("model") }, Array.from(models, ([name, label]) => el("option", { value: name }, label)));
  const timestep = el("input", { id: freshId("timestep"), type: "number", min: 0.1, max: 100, step: 0.1, value: number(1000 * lab.timestep) });
  const key = el("select", { id: freshId("key") }, el("option", { value: "" }, "the model's own"));
  const status = el("p", { class: "progress", role: "status" });
  const results = el("div");
  const note = el("div", { class: "prose meta" });
  if (lab.note) setProse(note, lab.note);
  let timer = 0, turn = null, shownModel = null;

  function offerKeys(answer) {
    if (answer.model === shownModel) return;
    shownModel = answer.model;
    key.replaceChildren(el("option", { value: "" }, "the model's own"), ...answer.keys.map((name) => el("option", {}, name)));
    key.value = answer.key ?? "";
  }

  async function run() {
    const mine = (turn = Symbol("turn"));
    status.textContent = "Running…";
    try {
      const chosen = model.value === shownModel ? { key: key.value } : {};
      const controls = { model: model.value, ...chosen, timestep: Number((timestep.valueAsNumber / 1000).toPrecision(12)) };
      const answer = await post("/labs:run", { ...target, controls, events: [] });
      if (mine !== turn) return;
      status.textContent = "";
      offerKeys(answer);
      results.replaceChildren(...shown(answer));
    } catch (error) {
      if (mine === turn) status.textContent = error.message;
    }
  }

  const soon = () => { clearTimeout(timer); timer = setTimeout(run, SETTLE_MS); };
  model.addEventListener("change", soon);
  key.addEventListener("change", soon);
  timestep.addEventListener("input", () => { if (timestep.validity.valid && timestep.value) soon(); });
  box.replaceChildren(el("div", { class: "controls" }, control("model", model), control("start", key), control("timestep (ms)", timestep)), status, results, note);
  run();
}

const control = (title, input) => el("div", { class: "control" }, el("label", { for: input.id }, title), input);

function shown(answer) {
  const runs = answer.integrators;
  return [
    chart({
      x: { label: "time (s)" },
      y: { label: "energy error (%)" },
      series: runs.map((run) => ({ label: run.name, x: run.times, y: run.energy_error_percent })),
    }),
    el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Energy and cost" }, el("table", {},
      el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "Integrator"),
        ...["Energy error at the end (%)", "Cost of a step (µs)"].map((title) => el("th", { scope: "col", class: "number" }, title)),
        el("th", { scope: "col" }, "Warnings"))),
      el("tbody", {}, runs.map(row)))),
    el("p", { class: "meta" }, `${number(answer.seconds)} s at a timestep of ${number(1000 * answer.timestep)} ms, from one state. `
      + "The cost is this server's and differs from run to run."),
  ];
}

function row(run) {
  const [first] = run.warnings;
  const signed = (value) => (value === null ? "no number" : (value > 0 ? "+" : value < 0 ? "−" : "") + Math.abs(value).toFixed(4));
  return el("tr", {},
    el("td", {}, run.name),
    el("td", { class: "number" }, signed(run.final_error_percent)),
    el("td", { class: "number" }, number(run.cost_us_per_step, 3)),
    el("td", {}, first ? `${first.kind} at ${number(first.time)} s` : "none"));
}
