// A lab on the page: its controls, the recorded run that the server sends for them, readouts, plots and warnings.

import { get, post, setProse } from "./api.js";
import { chart } from "./chart.js";
import { Controls } from "./controls.js";
import { el, freshId } from "./dom.js";
import { openIntegrators } from "./integrators.js";
import { Player } from "./player.js";
import { Scene } from "./scene.js";
import { Turning } from "./turning.js";

const SETTLE_MS = 150;
const HEIGHT = 260;
const SECONDS_MAX = 60;
const OVERLAYS = {
  frames: "body frames", joints: "joint axes", contacts: "contacts", forces: "contact forces", com: "centres of mass", sites: "sites",
};
const KINDS = {
  BADQPOS: "a position became huge or no number",
  BADQVEL: "a velocity became huge or no number",
  BADQACC: "an acceleration became huge or no number",
  BADCTRL: "a control became huge or no number",
};

// target: {quiz, question} once the learner has predicted, or {quiz, lab}. Opens once, and runs only while visible.
export function openLab(box, target) {
  if (box.dataset.open) return;
  box.dataset.open = "yes";
  box.hidden = false;
  const looking = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    looking.disconnect();
    fill(box, target);
  }, { rootMargin: "200px" });
  looking.observe(box);
}

async function fill(box, target) {
  try {
    const quiz = await get(`/quizzes/${encodeURIComponent(target.quiz)}`);
    const lab = target.lab ? quiz.labs.find((one) => one.id === target.lab) : quiz.questions.find((one) => one.id === target.question)?.lab;
    if (!lab) { delete box.dataset.open; box.hidden = true; return; }
    if (lab.kind === "integrators") openIntegrators(box, target, lab);
    else if (!lab.controls) box.replaceChildren(el("p", { class: "notice" }, `Labs of the kind “${lab.kind}” do not run here.`));
    else new SimLab(box, target, lab);
  } catch (error) {
    box.replaceChildren(el("p", { class: "notice bad" }, error.message));
  }
}

class SimLab {
  constructor(box, target, lab) {
    this.target = target;
    this.lab = lab;
    this.events = [];
    this.controls = new Controls(lab.controls, () => this.changed(), (label) => this.press(label));
    this.player = new Player((frame) => this.draw(frame));
    this.canvas = el("canvas", { role: "img", tabindex: 0, "aria-label": "The simulated scene; the arrow keys turn it, plus and minus move it" });
    this.canvas.style.height = `${lab.height ?? HEIGHT}px`;
    this.turning = new Turning(this.canvas, () => this.draw(this.player.frame));
    this.shown = new Set(Array.isArray(lab.overlays) ? lab.overlays : Object.entries(lab.overlays ?? {}).filter(([, on]) => on).map(([name]) => name));
    this.length = this.lengthBox();
    this.warnings = el("div", { role: "status" });
    this.readouts = lab.readouts.map(() => el("dd", {}));
    this.plots = el("div");
    this.note = lab.note ? el("div", { class: "prose meta" }) : null;
    box.replaceChildren(...[
      target.question ? el("h3", {}, "See for yourself") : null,
      this.canvas, this.togglesBox(), this.player.box, this.controls.box, this.warnings,
      lab.readouts.length ? el("dl", { class: "readouts" }, lab.readouts.map((readout, index) =>
        el("div", {}, el("dt", {}, readout.label), this.readouts[index]))) : null,
      this.plots, this.note,
    ].filter(Boolean));
    if (this.note) setProse(this.note, lab.note);
    new ResizeObserver(() => this.draw(this.player.frame)).observe(this.canvas);
    this.run(0);
  }

  // The length of the run, once the first run has told it.
  lengthBox() {
    const id = freshId("length");
    this.seconds = el("input", { id, type: "number", min: 0.1, max: SECONDS_MAX, step: "any" });
    this.seconds.addEventListener("change", () => {
      if (!this.seconds.validity.valid || !this.seconds.value) return;
      this.chosenSeconds = this.seconds.valueAsNumber;
      this.events = this.events.filter(([time]) => time <= this.chosenSeconds);
      this.run(0);
    });
    const box = el("div", { class: "control" }, el("label", { for: id }, "length of the run (s)"), this.seconds);
    this.controls.box.append(box);
    return box;
  }

  togglesBox() {
    const names = (this.lab.toggles ?? []).filter((name) => OVERLAYS[name]);
    if (!names.length) return null;
    return el("div", { class: "toggles", role: "group", "aria-label": "Drawn over the scene" }, names.map((name) => {
      const box = el("input", { type: "checkbox", checked: this.shown.has(name) });
      box.addEventListener("change", () => {
        if (box.checked) this.shown.add(name); else this.shown.delete(name);
        this.draw(this.player.frame);
      });
      return el("label", {}, box, ` ${OVERLAYS[name]} `);
    }));
  }

  changed() {
    this.events = [];
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.run(0), SETTLE_MS);
  }

  press(label) {
    const now = this.player.time;
    this.events = [...this.events.filter(([time]) => time <= now), [now, label]];
    this.run(now);
  }

  async run(from) {
    const turn = (this.turn = Symbol("turn"));
    try {
      const length = this.chosenSeconds ? { seconds: this.chosenSeconds } : {};
      const run = await post("/labs:run", { ...this.target, ...length, controls: this.controls.values, events: this.events });
      if (this.turn === turn) this.show(run, from);
    } catch (error) {
      if (this.turn === turn) this.warnings.replaceChildren(el("p", { class: "notice bad" }, error.message));
    }
  }

  show(run, from) {
    this.recorded = run;
    this.scene = new Scene(this.canvas, run.geoms, this.lab.camera, run.frames[0], this.turning);
    this.forceScale = this.lab.forceScale ?? fittingForces(run.overlays.contacts ?? [], this.scene.reach);
    if (document.activeElement !== this.seconds) this.seconds.value = run.seconds;
    this.warnings.replaceChildren(...warned(run.warnings));
    this.figures = run.plots.map((plot) => plotted(plot, run.times));
    this.plots.replaceChildren(...this.figures);
    this.player.load(run.times, from);
  }

  draw(frame) {
    const run = this.recorded;
    if (!run) return;
    const trail = run.trail ? run.trail.slice(0, frame + 1).filter((point) => !point.includes(null)) : [];
    const over = Object.entries(run.overlays).map(([name, frames]) => [name, frames[frame]]);
    this.scene.draw(run.frames[frame], trail, Object.fromEntries(over), this.shown, this.forceScale);
    run.readouts.forEach((readout, index) => {
      this.readouts[index].textContent = `${readout.texts[frame]}${readout.unit ? ` ${readout.unit}` : ""}`;
    });
    for (const figure of this.figures) figure.moveCursor(run.times[frame]);
  }
}

function warned(warnings) {
  if (!warnings.length) return [];
  const [first] = warnings;
  const more = warnings.length > 1 ? ` It warned ${warnings.length} times in this run.` : "";
  const why = KINDS[first.kind] ? `: ${KINDS[first.kind]}, and the state was reset` : "";
  return [el("p", { class: "notice bad" }, `MuJoCo warned ${first.kind} at ${first.time.toFixed(3)} s${why}.${more}`)];
}

// The scale [m/N] that draws the largest contact force of the run as a quarter of what the camera sees.
function fittingForces(frames, reach) {
  let largest = 0;
  for (const contacts of frames) for (const [, , , ...force] of contacts) largest = Math.max(largest, Math.hypot(...force));
  return largest ? (0.25 * reach) / largest : 0;
}

function plotted(plot, times) {
  return chart({
    height: plot.height,
    x: { label: plot.xlabel ?? "time (s)" },
    y: { label: plot.ylabel ?? "", min: plot.ymin ?? undefined, max: plot.ymax ?? undefined },
    series: plot.traces.map((trace) => ({ label: trace.label, x: times, y: trace.values, dash: trace.dash })),
    marks: plot.refLines.map((line) => (typeof line === "number" ? { y: line } : line)).filter((line) => typeof line.y === "number"),
  });
}
