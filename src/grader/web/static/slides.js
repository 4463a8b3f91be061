// Slides shown in class, one at a time on the full screen. Without this they stand below each other, a page each in print.

import { el } from "./dom.js";

const STEPS = { ArrowRight: 1, ArrowDown: 1, PageDown: 1, " ": 1, ArrowLeft: -1, ArrowUp: -1, PageUp: -1 };

const all = document.querySelector(".slides");
const slides = [...all.querySelectorAll(".slide")];
const start = el("button", { type: "button", onclick: show }, "Full screen");
const turn = (step, words) => el("button", { type: "button", class: "quiet small", onclick: () => go(at + step) }, words);
const [back, on] = [turn(-1, "Previous"), turn(1, "Next")];
const leave = el("button", { type: "button", class: "quiet small", onclick: stop }, "Leave");
let at = 0;

document.querySelector("[data-present]").prepend(start);
all.append(el("p", { class: "slide-keys" }, back, on, leave));
document.addEventListener("keydown", onKey);
document.addEventListener("fullscreenchange", () => document.fullscreenElement || stop());

async function show() {
  all.classList.add("showing");
  go(0);
  try {
    await all.requestFullscreen();
  } catch { /* a frame or a phone that allows none: the slides fill the window */ }
}

async function stop() {
  if (!isShowing()) return;
  all.classList.remove("showing");
  if (document.fullscreenElement) await document.exitFullscreen(); // until then nothing else takes the focus
  slides[at].scrollIntoView();
  start.focus({ preventScroll: true });
}

function go(wanted) {
  at = Math.min(Math.max(wanted, 0), slides.length - 1);
  slides.forEach((slide, place) => slide.classList.toggle("shown", place === at));
  back.disabled = at === 0;
  on.disabled = at === slides.length - 1;
  slides[at].tabIndex = -1;
  slides[at].focus(); // what a screen reader reads, and what the keys scroll
}

function onKey(event) {
  if (!isShowing() || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "Escape") return stop();
  if (event.key === " " && event.target.closest("button")) return;
  const wanted = event.key === "Home" ? 0 : event.key === "End" ? slides.length - 1 : at + STEPS[event.key];
  if (Number.isNaN(wanted)) return;
  event.preventDefault();
  go(wanted);
}

function isShowing() {
  return all.classList.contains("showing");
}
