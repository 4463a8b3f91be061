// A learner's pages. The server renders everything; this sends forms in the background, takes over the parts of the
// answer that changed, keeps drafts, and follows a script that is being graded. Without it the forms work as forms do.

import { Drafts } from "./drafts.js";

const TYPING_MS = 300;
const POLL_MS = 1500;
const SILENCE_MS = 6000;
const LABS = "[data-lab]:not([data-form])"; // those of unknown kinds have a form and nothing to run
const OFFLINE = "The server cannot be reached. Your answer is kept in this browser; send it again when you are back.";
const SIGNED_OUT = "You are signed out. Your answer is kept in this browser: sign in in another tab, then send it again here.";

const drafts = new Drafts(document.body.dataset.learner ?? "");
const announce = document.getElementById("announce");
const timers = new WeakMap();
let source = null; // the events of the script that is being graded

for (const form of document.querySelectorAll("form[data-answer]")) adopt(form);
for (const box of document.querySelectorAll(LABS)) watch(box);
follow();
window.addEventListener("storage", (event) => {
  const form = formOf(drafts.changed(event));
  if (form) drafts.mirror(form);
  if (form && drafts.wasSent(event)) refresh(form);
});

const formOf = (name) => name && document.querySelector(`form[data-answer="${CSS.escape(name)}"]`);

function adopt(form) {
  form.addEventListener("submit", (event) => { event.preventDefault(); send(form); });
  form.addEventListener("input", () => { drafts.keep(form); if (!form.dataset.editor && form.querySelector("input[type=text]")) echo(form); });
  drafts.restore(form);
  for (const node of form.querySelectorAll("[data-js]")) node.hidden = false;
  form.querySelector("[data-file]")?.addEventListener("change", (event) => load(form, event.target));
  form.querySelector("textarea.code")?.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) form.requestSubmit();
  });
}

function tell(form, sentence, bad = false) {
  const node = form.querySelector("[data-trouble]");
  node.textContent = sentence;
  node.classList.toggle("bad", bad);
  const field = form.querySelector("input[type=text]");
  if (field) field.toggleAttribute("aria-invalid", false);
  if (field && bad) field.setAttribute("aria-invalid", "true");
}

async function send(form) {
  const button = form.querySelector("button:not([type=button])");
  if (button.disabled) return;
  const sent = new FormData(form);
  button.disabled = true;
  tell(form, "Sending…");
  drafts.keep(form);
  try {
    const response = await fetch(form.action, { method: "POST", body: new URLSearchParams(sent), headers: { Accept: "text/html" }, credentials: "same-origin" });
    if (response.status === 401) return tell(form, SIGNED_OUT, true);
    const page = await pageOf(response);
    if (!page.querySelector(`form[data-answer="${CSS.escape(form.dataset.answer)}"]`)) return tell(form, page.querySelector("main p")?.textContent ?? OFFLINE, true);
    if (response.ok) drafts.sent(form);
    take(page, form, sent.get("answer"), response.ok);
  } catch {
    tell(form, OFFLINE, true);
  } finally {
    button.disabled = false;
  }
}

async function pageOf(response) {
  return new DOMParser().parseFromString(await response.text(), "text/html");
}

// Takes over the card of the form, the rail and the sums. What was typed while the answer travelled stays typed.
function take(page, form, sent, wasTaken) {
  const card = form.closest("[data-live]");
  if (page.body.dataset.learner && drafts.learner !== page.body.dataset.learner) begin(page);
  const typed = drafts.valueOf(form);
  for (const id of ["facts", "rail", "under-way", "attempts", "result"]) swap(page, id);
  if (card) {
    swap(page, card.id);
    const fresh = formOf(form.dataset.answer);
    adopt(fresh);
    const isNewer = lines(typed) !== lines(sent) && lines(typed) !== lines(drafts.valueOf(fresh));
    if (isNewer) { drafts.put(fresh, typed); drafts.keep(fresh); }
    for (const box of document.getElementById(card.id).querySelectorAll(LABS)) watch(box);
    const said = document.getElementById(card.id).querySelector(wasTaken ? "[data-said]" : "input[name=answer], textarea");
    if (document.hasFocus()) said?.focus({ preventScroll: true });
    if (document.hasFocus()) said?.scrollIntoView({ block: "nearest", behavior: "instant" });
  } else {
    const fresh = page.querySelector(`form[data-answer="${CSS.escape(form.dataset.answer)}"]`);
    for (const name of ["after", "learner"]) form.elements[name].value = fresh.elements[name].value;
    form.closest(".exercise")?.classList.toggle("tried", Boolean(page.querySelector(".exercise.tried")));
    if (typed && sent !== null && lines(typed) !== lines(sent)) drafts.keep(form);
    drafts.restore(form);
  }
  if (announce && !wasTaken) announce.textContent = formOf(form.dataset.answer).querySelector("[data-trouble]").textContent;
  follow();
}

const lines = (text) => (text ?? "").replaceAll("\r\n", "\n");

// The first answer has begun a session: every form of the page gets its name.
function begin(page) {
  const learner = (document.body.dataset.learner = page.body.dataset.learner);
  for (const form of document.querySelectorAll("form[data-answer]")) form.elements.learner.value = learner;
  drafts.begin(learner);
  const who = page.querySelector(".who");
  if (who && !document.querySelector(".who")) document.querySelector(".top > div").append(document.importNode(who, true));
}

function swap(page, id) {
  const [now, then] = [document, page].map((where) => where.getElementById(id));
  if (now && then) now.replaceWith(document.importNode(then, true));
}

async function refresh(form) {
  const response = await fetch(location.pathname + location.search, { headers: { Accept: "text/html" }, credentials: "same-origin" });
  if (response.ok) take(await pageOf(response), form, drafts.given(form), true);
}

// A script that is being graded: each event brings the page's new parts; without events it is asked for.
function follow() {
  const node = document.getElementById("under-way");
  source?.close();
  source = null;
  if (!node?.dataset.events) return;
  count(node.querySelector("[data-since]"));
  const form = node.closest("form");
  const again = async () => {
    try {
      const response = await fetch(location.pathname, { headers: { Accept: "text/html" }, credentials: "same-origin" });
      if (response.status === 401) return tell(form, SIGNED_OUT, true);
      if (response.ok) arrive(await pageOf(response), form);
    } catch {
      tell(form, "The connection is lost; your script is graded all the same.", true);
      setTimeout(follow, 2 * POLL_MS);
    }
  };
  const mine = (source = new EventSource(node.dataset.events));
  let silence = setTimeout(again, SILENCE_MS);
  for (const name of ["running", "graded", "needs_review"]) mine.addEventListener(name, () => { clearTimeout(silence); if (source === mine) again(); });
  mine.addEventListener("error", () => { clearTimeout(silence); if (source === mine) { mine.close(); silence = setTimeout(again, POLL_MS); } });
}

function arrive(page, form) {
  const before = document.getElementById("under-way").dataset.events;
  const done = !page.getElementById("under-way").dataset.events;
  take(page, form, null, true);
  if (!done || !before) return;
  const status = document.querySelector("#result [data-status]");
  if (status && announce) announce.textContent = status.closest(".verdict-head").innerText;
  document.querySelector("#result .verdict")?.scrollIntoView({ block: "nearest" });
}

function count(node) {
  if (!node) return;
  const started = Date.now();
  const tick = () => {
    if (!node.isConnected) return;
    const seconds = Math.round((Date.now() - started) / 1000);
    if (seconds) node.textContent = `${seconds}\u202fs`;
    setTimeout(tick, 1000);
  };
  tick();
}

// Says how a number is read while it is typed; the API's module is fetched when it is first needed.
function echo(form) {
  clearTimeout(timers.get(form));
  const typed = form.elements.answer.value;
  if (!typed.trim()) return tell(form, "");
  timers.set(form, setTimeout(async () => {
    const [quiz, question] = form.dataset.answer.split("/");
    const { post } = await import("./api.js");
    try {
      const understood = await post("/answers:validate", { quiz, question, answer: typed });
      if (form.elements.answer.value !== typed) return;
      tell(form, understood.valid ? `read as ${understood.read_as}` : understood.message, !understood.valid);
    } catch (error) {
      if (form.elements.answer.value === typed) tell(form, error.message, true);
    }
  }, TYPING_MS));
}

async function load(form, input) {
  const [file] = input.files;
  if (!file) return;
  try {
    const text = new TextDecoder("utf-8", { fatal: true }).decode(await file.arrayBuffer());
    drafts.put(form, text);
    drafts.keep(form);
    tell(form, `${file.name} is loaded; not handed in yet.`);
  } catch {
    tell(form, "This file is not UTF-8 text; save it as a plain .py file.", true);
  }
  input.value = ""; // the same file may be loaded again
}

// Labs are fetched when they come near the screen.
function watch(box) {
  const looking = new IntersectionObserver(async (entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    looking.disconnect();
    const { openLab } = await import("./lab.js");
    const { lab: quiz, labId, labQuestion } = box.dataset;
    openLab(box, labQuestion ? { quiz, question: labQuestion } : { quiz, lab: labId });
  }, { rootMargin: "200px" });
  looking.observe(box);
}
