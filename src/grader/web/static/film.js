// The films of a verdict: the judge's runs side by side on one clock, with their distance where there is one. The server
// has drawn the box in its final size; nothing here changes a size.

import { get } from "./api.js";
import { drawChart } from "./chart.js";
import { el, number } from "./dom.js";
import { Newest } from "./newest.js";
import { lastUntil, Player } from "./player.js";
import { Scene, watchLooks } from "./scene.js";
import { Turning } from "./turning.js";

const TICKS = 600; // of the clock
const FITTED_FRAMES = 40;
const NEARER = 0.8, NARROW = 0.8; // than labs show a scene; of the height, where there is no room for that
const PAST = 4; // frames whose outlines stay

const styled = new Promise((resolve) => {
  document.head.append(el("link", { rel: "stylesheet", href: new URL("film.css", import.meta.url).href, onload: resolve, onerror: resolve }));
});

// Opens once.
export async function openFilm(box) {
  if (box.dataset.open) return;
  box.dataset.open = "yes";
  const message = box.querySelector("[data-message]");
  try {
    const [{ films }] = await Promise.all([get(`/submissions/${encodeURIComponent(box.dataset.film)}/films`), styled]);
    if (films.length) new Films(box, films);
    else message.textContent = "These runs can no longer be shown: the exercise has changed since.";
  } catch (error) {
    message.textContent = error.message;
  }
}

class Films {
  constructor(box, films) {
    const find = (selector) => box.querySelector(selector);
    Object.assign(this, { films, runs: find(".runs"), picture: find(".strips"), message: find("[data-message]") });
    this.turning = new Turning(this.runs, () => this.draw());
    this.player = new Player(box, () => this.draw());
    const choice = find("[data-choice]");
    choice?.replaceChildren(...films.map(({ name, title }) => el("option", { value: name }, title)));
    choice?.toggleAttribute("disabled", films.length < 2);
    choice?.addEventListener("change", () => { this.show(films.find(({ name }) => name === choice.value)); this.player.restart(); });
    this.listenToTimestep(find("[data-timestep]"), find("[data-chosen]"), box.dataset.film);
    this.picture?.addEventListener("pointerdown", (event) => { this.picture.setPointerCapture(event.pointerId); this.seek(event); });
    this.picture?.addEventListener("pointermove", (event) => { if (event.buttons) this.seek(event); });
    watchLooks(this.runs, () => { this.drawDistance(); this.draw(); });
    this.show(films[0]);
  }

  // The claim is dragged along its axis, and the runs follow.
  listenToTimestep(slider, says, id) {
    if (!slider) return;
    const fail = (error) => { this.message.textContent = error.message; };
    const runs = new Newest((ms) => get(`/submissions/${encodeURIComponent(id)}/films?timestep_ms=${ms}`), ({ films: [film] }) => {
      if (film) this.show(film, this.player.time);
    }, fail);
    slider.disabled = false;
    slider.addEventListener("input", () => {
      says.textContent = `${slider.value} ms`;
      slider.setAttribute("aria-valuetext", says.textContent);
      runs.want(slider.value);
    });
  }

  seek(event) {
    if (this.chart) this.player.seek(this.chart.timeAt(event.clientX));
  }

  show(film, from = 0) {
    this.film = film;
    const panels = film.panels.map((panel) => {
      const canvas = el("canvas", { role: "img", "aria-label": [panel.title, panel.detail, panel.ended].filter(Boolean).join(", ") });
      const says = el("span", { class: "says" });
      const node = el("div", { class: `run ${panel.integrator}` }, canvas, el("p", {}, el("b", {}, panel.title)), el("p", { class: "meta" }, panel.detail), el("p", {}, says));
      return { ...panel, canvas, says, node };
    });
    this.runs.replaceChildren(...panels.map(({ node }) => node));
    const frames = film.panels.flatMap(({ frames, ended }) => fitted(frames, ended));
    for (const panel of panels) {
      panel.scene = new Scene(panel.canvas, film.geoms, {}, frames, this.turning);
      if (panel.canvas.clientWidth > NARROW * panel.canvas.clientHeight) panel.scene.camera.distance *= NEARER;
    }
    this.panels = panels;
    this.message.textContent = film.caption;
    this.drawDistance();
    const clock = Array.from({ length: TICKS + 1 }, (_, tick) => (film.end * tick) / TICKS);
    this.player.load(clock, film.end, from);
  }

  drawDistance() {
    const { distance, end } = this.film ?? {};
    if (!distance || !this.picture) return;
    const values = distance.values.map((value) => (value > 0 ? value : null));
    const series = [{ label: "", className: "series-1", times: distance.times, values }];
    this.chart = drawChart(this.picture, { end, strips: [{
      label: `${distance.label} (rad or m)`, weight: 1, axis: { log: true }, shows: [...values.filter(Boolean), distance.tolerance], series, ghost: [],
      lines: [{ y: distance.tolerance, label: "passes below" }],
    }] });
  }

  draw() {
    if (!this.panels) return;
    const { time } = this.player;
    for (const panel of this.panels) {
      const at = lastUntil(panel.times, time), behind = this.panels[panel.behind];
      const past = behind || this.film.distance ? [] : panel.frames.slice(Math.max(0, at - PAST), at);
      panel.scene.draw({ poses: panel.frames[at], ghost: behind?.frames[lastUntil(behind.times, time)], past });
      const isOver = Boolean(panel.ended) && at === panel.times.length - 1;
      panel.node.classList.toggle("is-over", isOver);
      panel.says.textContent = isOver ? panel.ended : this.valueOf(panel, at);
    }
    this.chart?.moveCursor(time);
  }

  valueOf({ values }, at) {
    return this.film.unit && values.length ? `${number(values[at], 3)} ${this.film.unit}` : "";
  }
}

// Some frames of a run; of one that ended early the first half, since the end of it is wild.
function fitted(frames, ended) {
  const shown = ended ? frames.slice(0, Math.ceil(frames.length / 2)) : frames;
  const stride = Math.ceil(shown.length / FITTED_FRAMES);
  return shown.filter((_, index) => index % stride === 0);
}
