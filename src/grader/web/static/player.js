// Plays a recorded run: play and pause, a time slider, the speed; calls a listener with each frame that it shows.

const SHORT_S = 1; // a run whose end comes sooner is played slowly at first
const SLOW = "0.1";

export class Player {
  constructor(box, onFrame) {
    this.onFrame = onFrame;
    this.times = [0];
    this.frame = this.last = 0;
    this.playing = this.started = this.seen = false;
    this.button = box.querySelector("[data-play]");
    this.slider = box.querySelector("[data-time]");
    this.clock = box.querySelector("[data-clock]");
    this.speeds = [...box.querySelectorAll(".speeds input")];
    this.button.addEventListener("click", () => (this.playing ? this.pause() : this.play()));
    this.slider.addEventListener("input", () => this.seek(this.times[this.slider.value]));
    for (const speed of this.speeds) speed.addEventListener("change", () => { this.chosen = true; if (this.playing) this.play(); });
    for (const node of [this.button, this.slider, ...this.speeds]) node.disabled = false;
    new IntersectionObserver(([entry]) => this.noticed(entry.isIntersecting), { threshold: 0.5 }).observe(box.querySelector("[data-stage]"));
  }

  get time() {
    return this.times[this.frame];
  }

  get speed() {
    return Number(this.speeds.find((speed) => speed.checked).value);
  }

  // Another run, which is shown up to `end` [s], from `from` [s] on.
  load(times, end, from) {
    this.times = times;
    this.last = this.frameAt(end);
    this.slider.max = this.last;
    if (!this.chosen) for (const speed of this.speeds) speed.checked = speed.value === (end < SHORT_S ? SLOW : "1");
    this.show(Math.min(this.last, this.frameAt(from)));
    if (this.playing) this.play();
    else this.start();
  }

  // The first run starts when it is seen, unless the learner wants nothing to move; out of sight nothing moves.
  noticed(seen) {
    this.seen = seen;
    if (seen) this.start();
    else this.pause();
  }

  start() {
    if (this.started || !this.seen || this.times.length < 2) return;
    this.started = true;
    this.restart();
  }

  restart() {
    this.show(0);
    this.go();
  }

  // Plays, where it is seen and the learner wants motion.
  go() {
    if (this.seen && !matchMedia("(prefers-reduced-motion: reduce)").matches) this.play();
  }

  play() {
    if (this.frame >= this.last) this.show(0);
    const { speed } = this, began = performance.now() / 1000, at = this.time;
    const turn = (this.turn = Symbol("turn"));
    this.setPlaying(true);
    const step = (now) => {
      if (!this.playing || this.turn !== turn) return;
      this.show(Math.min(this.last, this.frameAt(at + speed * Math.max(0, now / 1000 - began))));
      if (this.frame < this.last) requestAnimationFrame(step);
      else this.pause();
    };
    requestAnimationFrame(step);
  }

  pause() {
    this.setPlaying(false);
  }

  // The learner moves through time: from now on nothing starts by itself.
  seek(time) {
    this.started = true;
    this.pause();
    this.show(Math.min(this.last, this.frameAt(time)));
  }

  setPlaying(playing) {
    this.playing = playing;
    this.button.textContent = playing ? "Pause" : "Play";
  }

  show(frame) {
    this.frame = frame;
    this.slider.value = frame;
    this.clock.textContent = `${this.time.toFixed(3)} s`;
    this.slider.setAttribute("aria-valuetext", this.clock.textContent);
    this.onFrame(frame);
  }

  frameAt(time) {
    return lastUntil(this.times, time);
  }
}

// The index of the last of these times that is not later than `time`.
export function lastUntil(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (times[middle] <= time + 1e-9) low = middle;
    else high = middle - 1;
  }
  return low;
}
