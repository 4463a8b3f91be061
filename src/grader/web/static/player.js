// Plays a recorded run, with a time slider, and calls listeners with each frame that it shows.

import { el } from "./dom.js";

export class Player {
  constructor(onFrame) {
    this.onFrame = onFrame;
    this.times = [0];
    this.frame = 0;
    this.playing = false;
    this.button = el("button", { type: "button", class: "quiet", onclick: () => (this.playing ? this.pause() : this.play()) }, "Play");
    this.slider = el("input", { type: "range", min: 0, max: 0, value: 0, "aria-label": "Time in the run" });
    this.slider.addEventListener("input", () => { this.pause(); this.show(Number(this.slider.value)); });
    this.clock = el("output", {}, "0.00 s");
    this.box = el("div", { class: "player" }, this.button, this.slider, this.clock);
  }

  get time() {
    return this.times[this.frame];
  }

  load(times, from = 0) {
    this.times = times;
    this.slider.max = times.length - 1;
    this.show(this.frameAt(from));
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.play();
  }

  play() {
    if (this.frame >= this.times.length - 1) this.show(0);
    const offset = this.time - performance.now() / 1000;
    const turn = (this.turn = Symbol("turn"));
    this.setPlaying(true);
    const step = (now) => {
      if (!this.playing || this.turn !== turn) return;
      this.show(this.frameAt(offset + now / 1000));
      if (this.frame < this.times.length - 1) requestAnimationFrame(step);
      else this.pause();
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.setPlaying(false);
  }

  setPlaying(playing) {
    this.playing = playing;
    this.button.textContent = playing ? "Pause" : "Play";
  }

  show(frame) {
    this.frame = frame;
    this.slider.value = frame;
    this.clock.textContent = `${this.time.toFixed(2)} s`;
    this.slider.setAttribute("aria-valuetext", this.clock.textContent);
    this.onFrame(frame);
  }

  // The last frame that is not later than `time`.
  frameAt(time) {
    let low = 0, high = this.times.length - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.times[middle] <= time + 1e-9) low = middle;
      else high = middle - 1;
    }
    return low;
  }
}
