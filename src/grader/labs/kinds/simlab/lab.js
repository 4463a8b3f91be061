// A lab on the page: asks the server for a run under its controls, and shows scene, plots, readouts and warnings of it.
// The server has drawn every part in its final size; nothing here changes a size.

import { drawChart } from "../chart.js";
import { Controls } from "../controls.js";
import { limitText, number, seconds } from "../dom.js";
import { Newest } from "../newest.js";
import { fittingForces } from "../overlays.js";
import { lastUntil, Player } from "../player.js";
import { Pulling } from "../pulling.js";
import { Scene, watchLooks } from "../scene.js";
import { spanOf, stripsOf, warningOf } from "../strips.js";
import { Turning } from "../turning.js";

const INTEGRATORS = ["Euler", "RK4", "implicit", "implicitfast", "discrete"];
const FITTED_FRAMES = 30;
const PULL_S = 0.4; // how long a pull lasts
const PULLS_MAX = 8; // as the server takes
const KINDS = {
  BADQPOS: "a position became huge or NaN",
  BADQVEL: "a velocity became huge or NaN",
  BADQACC: "an acceleration became huge or NaN",
  BADCTRL: "a control became huge or NaN",
};

export function open(box, page) {
  new SceneLab(box, page);
}

// Some frames of a run, from its start until it diverged.
function sampled(run) {
  const warning = warningOf(run), until = warning?.resets ? warning.time / 2 : Infinity;
  const stride = Math.ceil(run.frames.length / FITTED_FRAMES);
  return run.frames.filter((_, i) => i % stride === 0 && run.times[i] <= until);
}

class SceneLab {
  constructor(box, page) {
    const { lab } = page;
    const one = (selector) => box.querySelector(selector);
    Object.assign(this, { page, lab, events: [], pulls: [], canvas: one("canvas"), after: one("[data-after]") });
    this.picture = one(".strips");
    this.list = one(".readouts");
    this.readouts = this.list ? [...this.list.querySelectorAll("dd")] : [];
    this.runs = new Newest((wish) => this.ask(wish), (run, wish) => this.show(run, wish), (error) => this.page.tell(error.message, true));
    this.pulling = new Pulling(this.canvas, { body: one("[data-body]"), way: one("[data-way]"), button: one("[data-pull]") }, this);
    this.turning = new Turning(this.canvas, () => this.draw());
    this.controls = new Controls(box, lab.controls, {
      begin: () => { this.last = this.recorded; },
      change: (spec) => this.changed(spec),
      press: (label) => this.press(label),
      refuse: (sentence) => this.page.tell(sentence, true),
    });
    this.player = new Player(box, () => this.draw());
    this.listenToSeconds(one("[data-seconds]"));
    this.listenToToggles(box);
    this.listenToPlot();
    watchLooks(this.picture, () => { this.drawPlots(); this.draw(); });
    this.runs.want({ from: 0 });
  }

  listenToSeconds(input) {
    input.disabled = false;
    input.addEventListener("change", () => {
      if (!input.validity.valid || !input.value) return this.page.tell("A run lasts from 0.1 to 60 s.", true);
      this.seconds = input.valueAsNumber;
      this.events = this.events.filter(([time]) => time <= this.seconds);
      this.pulls = this.pulls.filter(({ begin }) => begin < this.seconds);
      this.runs.want({ from: 0 });
    });
  }

  listenToToggles(box) {
    const { overlays } = this.lab;
    this.shown = new Set(Array.isArray(overlays) ? overlays : Object.keys(overlays ?? {}).filter((name) => overlays[name]));
    for (const toggle of box.querySelectorAll("[data-toggle]")) {
      toggle.disabled = false;
      toggle.addEventListener("change", () => {
        if (toggle.checked) this.shown.add(toggle.value); else this.shown.delete(toggle.value);
        this.draw();
      });
    }
    this.mayHideShadows = Boolean(box.querySelector("[data-toggle][value=shadows]"));
    this.ghost = box.querySelector("[data-ghost]");
    this.ghost.querySelector("input").addEventListener("change", () => { this.drawPlots(); this.draw(); });
  }

  // In the plots, dragging moves through time.
  listenToPlot() {
    const seek = (event) => { if (this.chart) this.player.seek(this.chart.timeAt(event.clientX)); };
    this.picture.addEventListener("pointerdown", (event) => { this.picture.setPointerCapture(event.pointerId); seek(event); });
    this.picture.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
  }

  changed({ reset }) {
    this.events = [];
    this.pulls = [];
    this.runs.want({ isNew: reset });
  }

  press(label) {
    const now = this.player.time;
    this.last = this.recorded;
    this.events = [...this.events.filter(([time]) => time <= now), [now, label]];
    this.runs.want({ from: now });
  }

  pause() {
    this.player.seek(this.player.time);
  }

  // From now on a spring pulls the point of a geom to its goal; after the end of a run, from its start.
  pull(geom, point, goal) {
    const begin = this.player.frame >= this.player.last ? 0 : this.player.time;
    this.last = this.recorded;
    this.pulls = [...this.pulls.filter((one) => one.begin < begin), { geom, point, goal, begin, end: begin + PULL_S }].slice(-PULLS_MAX);
    this.runs.want({ from: begin, isPulled: true });
  }

  ask() {
    const length = this.seconds ? { seconds: this.seconds } : {};
    return this.page.run(this.controls.values, { ...length, events: this.events, pulls: this.pulls });
  }

  // wish: where the run is shown from, or that it starts anew; otherwise time stays where it is. A pulled run plays on.
  show(run, { from, isNew, isPulled }) {
    this.recorded = run;
    const scene = new Scene(this.canvas, run.geoms, { ...this.scene?.camera, ...this.lab.camera }, sampled(run), this.turning);
    this.scene = scene;
    this.forceScale = this.lab.forceScale ?? fittingForces(run.overlays.contacts ?? [], scene.camera.distance);
    this.integrator = this.controls.choices(run.controls).find((text) => INTEGRATORS.includes(text));
    this.controls.mark(run, this.integrator ?? "");
    this.page.tell(...this.said(run));
    this.nameGhost(run, isPulled);
    this.pulling.name(run.geoms);
    this.drawPlots();
    this.player.load(run.times, spanOf(run), from ?? this.player.time);
    if (isNew) this.player.restart();
    else if (isPulled) this.player.go();
  }

  nameGhost(run, isPulled) {
    const there = this.last && this.last !== run;
    const differs = there ? this.controls.difference(this.last.controls, run.controls) : "";
    this.ghost.classList.toggle("there", Boolean(there));
    this.ghost.querySelector("input").disabled = !there;
    this.ghost.querySelector("span").textContent = differs ? `last run: ${differs}` : isPulled ? "last run: without this pull" : "last run";
  }

  get shownGhost() {
    return this.last && this.last !== this.recorded && this.ghost.querySelector("input").checked ? this.last : null;
  }

  // What happened, and how the timestep stands to the limit.
  said(run) {
    const warning = warningOf(run), { limit } = run;
    const who = this.integrator ?? "This integrator";
    const step = limit && run.controls[limit.control];
    const isAbove = limit?.timestep_s && step > limit.timestep_s;
    const pulled = this.pulls.length ? `Pulled from ${seconds(this.pulls.at(-1).begin)} to ${seconds(this.pulls.at(-1).end)}.` : "";
    const bound = limit && (limit.timestep_s ? `${who} is stable up to ${limitText(limit, run)} here${isAbove ? `; you step ${seconds(step)}` : ""}.`
      : `${who} is stable in the whole range of this timestep.`);
    if (!warning) {
      const calm = isAbove ? `Grows; no warning within ${number(run.seconds)} s.` : `No warning within ${number(run.seconds)} s.`;
      return [[pulled, calm, bound].filter(Boolean).join(" "), Boolean(isAbove)];
    }
    const why = warning.resets ? `: ${KINDS[warning.kind]}, and the state was reset` : "";
    const part = spanOf(run) < run.times.at(-1) ? `Shown are the first ${seconds(spanOf(run))}.` : "";
    return [[pulled, `MuJoCo warned ${warning.kind} at ${seconds(warning.time)}${why}.`, bound, part].filter(Boolean).join(" "), true];
  }

  drawPlots() {
    const run = this.recorded;
    if (!run) return;
    this.chart = drawChart(this.picture, {
      end: spanOf(run),
      xlabel: run.plots.find((plot) => plot.xlabel)?.xlabel,
      strips: stripsOf(run, this.shownGhost, this.integrator),
      warning: warningOf(run),
    });
  }

  draw() {
    const run = this.recorded;
    if (!run) return;
    const frame = Math.min(this.player.frame, run.times.length - 1), time = run.times[frame], warning = warningOf(run);
    const ghost = this.shownGhost;
    this.scene.draw({
      poses: run.frames[frame],
      ghost: ghost?.frames[lastUntil(ghost.times, time)],
      trail: run.trail ? run.trail.slice(0, frame + 1).filter((point) => !point.includes(null)) : [],
      over: Object.fromEntries(Object.entries(run.overlays).map(([name, frames]) => [name, frames[frame]])),
      shown: this.shown,
      forceScale: this.forceScale,
      pull: this.pulling.arrow,
      hasShadows: !this.mayHideShadows || this.shown.has("shadows"),
    });
    const isAfter = Boolean(warning?.resets && time > warning.time + 1e-9);
    this.after.hidden = !isAfter;
    this.canvas.classList.toggle("is-after", isAfter);
    run.readouts.forEach(({ texts, unit }, index) => {
      const cell = this.readouts[index];
      cell.textContent = texts[frame].replace(/^-(?=[0.]*$)/, "").replace(/^-(?=\d)/, "−") + (unit ? ` ${unit}` : "");
      cell.classList.toggle("is-after", isAfter && texts.some((text) => text !== texts[0]));
    });
    this.chart?.moveCursor(time);
  }
}
