// A learner's pages. The server renders all; this sends forms, takes over what changed, keeps drafts, and follows a
// script that is being graded. Without it forms work as forms do.

import { alone, Drafts, same } from "./drafts.js";
import { localise } from "./times.js";

const POLL_MS = 1500;
const SILENCE_MS = 6000;
const LABS = "[data-form], [data-film]";
const OFFLINE = "The server cannot be reached. Your answer is kept in this browser; send it again when you are back.";

const drafts = new Drafts(document.body.dataset.learner ?? "");
const announce = document.getElementById("announce");
const here = { drafts, tell, buttonOf, OFFLINE };
const fields = (use) => import("./fields.js").then(use).catch(() => {}); // what is not needed before something is typed
// Films wait for the reader's first move, so that the first load stays small. A page may also scroll by itself, and the
// browser reports where a pointer lies that has not moved.
const stirred = new Promise((resolve) => {
  const hear = ({ type, movementX, movementY }) => { if (type !== "pointermove" || movementX || movementY) resolve(); };
  for (const name of ["pointermove", "pointerdown", "keydown", "wheel"]) addEventListener(name, hear, { passive: true });
});
let source = null; // the events of the script that is being graded
let taken = 0; // how many pages were taken over

for (const form of document.querySelectorAll("form[data-answer]")) adopt(form);
for (const box of document.querySelectorAll(LABS)) watch(box);
follow();
addEventListener("storage", (event) => {
  const form = formOf(drafts.changed(event));
  if (form) drafts.mirror(form, event);
  if (form && drafts.wasSent(event)) refresh(form);
});

document.addEventListener("click", (event) => {
  const { target } = event;
  if (target.dataset.goTo) goToLine(event, Number(target.dataset.goTo));
  if (target.dataset.intoEditor === undefined) return;
  const form = document.querySelector("form[data-editor]");
  const lines = [...target.closest("details").querySelectorAll("pre > span")].map((line) => line.textContent);
  drafts.put(form, { answer: [`${lines.join("\n")}\n`] });
  drafts.keep(form);
  form.elements.answer.focus();
});
document.addEventListener("toggle", ({ target }) => {
  if (target.open && target.closest(".statement")) target.scrollIntoView({ block: "nearest" });
}, true);

const formOf = (name, page = document) => name && page.querySelector(`form[data-answer="${CSS.escape(name)}"]`);

function adopt(form) {
  form.addEventListener("submit", (event) => { event.preventDefault(); send(form, event.submitter); });
  form.addEventListener("input", () => { drafts.keep(form); stepBack(form); if (form.querySelector("[data-echo]")) fields(({ echo }) => echo(form, here)); });
  drafts.restore(form);
  stepBack(form);
  for (const node of form.querySelectorAll("[data-js]")) node.hidden = false;
  const parts = form.querySelector("[data-arrange]");
  if (parts) import("./arrange.js").then(({ arrange }) => arrange(parts)).catch(() => {});
  form.querySelector("[data-file]")?.addEventListener("change", ({ target }) => fields(({ load }) => load(form, target, here)));
  const code = form.querySelector("textarea.code");
  if (code) numberLines(code, code.previousElementSibling);
  const edit = () => import("./editor.js").then(({ openEditor }) => openEditor(code)).catch(() => {});
  if (code) new PerformanceObserver((_, paints) => paints.disconnect(edit())).observe({ type: "paint", buffered: true });
  code?.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && !event.isComposing && (event.ctrlKey || event.metaKey)) form.requestSubmit();
  });
}

// Numbers the lines of the code, and scrolls with it.
function numberLines(code, gutter) {
  let count = 0;
  const draw = () => {
    const lines = code.value.split("\n").length;
    if (lines !== count) gutter.textContent = Array.from({ length: (count = lines) }, (_, index) => index + 1).join("\n");
    gutter.scrollTop = code.scrollTop;
  };
  for (const name of ["input", "change", "scroll"]) code.addEventListener(name, draw);
  draw();
}

// Puts the caret into a line of the code that a verdict names.
function goToLine(event, number) {
  const code = document.querySelector("form[data-editor] textarea.code");
  const before = code.value.split("\n").slice(0, number - 1);
  event.preventDefault();
  code.focus({ preventScroll: true });
  code.setSelectionRange(...Array(2).fill(before.join("\n").length + (number > 1)));
  code.scrollTop = (before.length - 2) * parseFloat(getComputedStyle(code).lineHeight);
  code.scrollIntoView({ block: "nearest" });
}

// The verdict steps back while the field holds something else than what it is on.
function stepBack(form) {
  const said = form.closest("[data-live]")?.querySelector("[data-said]");
  said?.classList.toggle("is-old", !same(drafts.valueOf(form), drafts.given(form)));
}

function buttonOf(form) {
  return form.querySelector("button:not([type=button], [data-stop])");
}

function tell(form, sentence, bad = false, isTyped = bad) {
  const node = form.querySelector("[data-trouble]");
  node.textContent = sentence;
  node.classList.toggle("bad", bad);
  for (const field of form.querySelectorAll("input[type=text]")) {
    field.toggleAttribute("aria-invalid", false);
    const name = field.dataset.echo; // the label of one of several numbers, with which a sentence on it begins
    if (isTyped && (!name || sentence.startsWith(`${name}:`))) field.setAttribute("aria-invalid", "true");
  }
}

async function send(form, submitter) {
  const isStop = submitter?.dataset.stop !== undefined;
  const button = isStop ? submitter : buttonOf(form);
  if (button.disabled) return;
  const sent = new FormData(form, submitter); // an image that was clicked adds where
  const typed = drafts.valueOf(form);
  button.disabled = true;
  tell(form, isStop ? "Stopping…" : "Sending…");
  drafts.keep(form);
  try {
    const body = form.enctype === "multipart/form-data" ? sent : new URLSearchParams(sent);
    const post = () => fetch(isStop ? submitter.formAction : form.action, { method: "POST", body, headers: { Accept: "text/html" } });
    const response = await (document.body.dataset.learner ? post() : alone(post));
    const page = await pageOf(response);
    if (!formOf(form.dataset.answer, page)) return tell(form, page.querySelector("main p")?.textContent ?? OFFLINE, true);
    if (response.ok && !isStop) drafts.sent(form);
    take(page, form, typed, response.ok);
    if (isStop) drafts.keep(form); // it is as if it had not been sent
  } catch {
    tell(form, OFFLINE, true, false);
  } finally {
    button.disabled = false;
  }
}

async function pageOf(response) {
  const page = new DOMParser().parseFromString(await response.text(), "text/html");
  localise(page);
  return page;
}

// Takes over the card of the form, the rail and the sums. What was typed meanwhile stays typed.
function take(page, form, sent, wasTaken, isOwn = true) {
  const card = form.closest("[data-live]");
  const begun = isOwn ? undefined : form.elements.after.value;
  taken += 1;
  if (page.body.dataset.learner && drafts.learner !== page.body.dataset.learner) begin(page, card);
  const typed = drafts.valueOf(form);
  for (const id of ["facts", "first", "rail", "under-way", "attempts", "result"]) swap(page, id);
  for (const box of document.querySelectorAll("#result [data-film]")) watch(box);
  if (card) {
    const held = document.activeElement;
    swap(page, card.id);
    const fresh = formOf(form.dataset.answer);
    adopt(fresh);
    const isNewer = !same(typed, sent) && !same(typed, drafts.valueOf(fresh));
    const now = document.getElementById(card.id);
    for (const box of now.querySelectorAll(LABS)) watch(box);
    const wanted = wasTaken ? ["[data-said]"] : ["[aria-invalid]", "[name=answer], [name^='answer.']"];
    const said = wanted.map((selector) => now.querySelector(selector)).find(Boolean);
    if (isNewer) { // typing goes on
      drafts.put(fresh, typed);
      drafts.keep(fresh, begun);
      const field = document.getElementById(held.id);
      field?.focus({ preventScroll: true });
      if (held.selectionEnd) field?.setSelectionRange(held.selectionStart, held.selectionEnd);
    } else if (held !== document.body && !card.contains(held)) announce.textContent = said?.querySelector("[data-status]")?.textContent ?? "";
    else if (document.hasFocus()) {
      said?.focus({ preventScroll: true });
      said?.scrollIntoView({ block: "nearest", behavior: "instant" });
    }
  } else {
    const fresh = formOf(form.dataset.answer, page);
    for (const name of ["after", "learner"]) form.elements[name].value = fresh.elements[name].value;
    form.closest(".exercise")?.classList.toggle("tried", Boolean(page.querySelector(".exercise.tried")));
    if (typed.answer?.[0] && sent !== null && !same(typed, sent)) drafts.keep(form, begun);
    drafts.restore(form);
  }
  if (announce && !wasTaken) announce.textContent = formOf(form.dataset.answer).querySelector("[data-trouble]").textContent;
  follow();
}

// The first answer has begun a session: forms get its name, questions the learner's own numbers, if there are any.
function begin(page, sent) {
  const learner = (document.body.dataset.learner = page.body.dataset.learner);
  drafts.begin(learner);
  for (const form of document.querySelectorAll("form[data-answer]")) {
    const card = form.closest("[data-live]");
    if (card === sent || !card?.querySelector("[data-numbers]")) form.elements.learner.value = learner;
    else if (page.getElementById(card.id)) {
      swap(page, card.id);
      const fresh = formOf(form.dataset.answer);
      adopt(fresh);
      tell(fresh, "These numbers are yours: read it again.");
    }
  }
  const who = page.querySelector(".who");
  if (who) document.querySelector(".who")?.replaceWith(document.importNode(who, true));
}

function swap(page, id) {
  const [now, then] = [document, page].map((where) => where.getElementById(id));
  if (now && then) now.replaceWith(document.importNode(then, true));
}

async function refresh(form) {
  const before = taken;
  const [, page] = await ask(location.pathname + location.search);
  if (before !== taken) return refresh(form); // it may be older than what stands here
  if (page) take(page, form, drafts.given(form), true, false);
}

// The status and the page at an address; no page where the server has none or cannot be reached.
async function ask(address) {
  try {
    const response = await fetch(address, { headers: { Accept: "text/html" } });
    return [response.status, response.ok ? await pageOf(response) : null];
  } catch {
    return [0, null];
  }
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
    const [status, page] = await ask(location.pathname);
    if (source !== mine) return; // asked for before the page changed
    if (page) return arrive(page, form);
    tell(form, status === 401 ? SIGNED_OUT : "The connection is lost; your script is graded all the same.", true);
    if (status !== 401) setTimeout(follow, 2 * POLL_MS);
  };
  const mine = (source = new EventSource(node.dataset.events));
  let silence = setTimeout(again, SILENCE_MS);
  const heard = (isNews) => { clearTimeout(silence); if (source === mine && isNews) again(); };
  mine.addEventListener("running", () => heard(node.dataset.state !== "running"));
  for (const name of ["graded", "needs_review"]) mine.addEventListener(name, () => heard(true));
  mine.addEventListener("progress", ({ data }) => {
    const { case: at, cases, within } = JSON.parse(data);
    node.querySelector("[data-case]").textContent = `, case ${at} of ${cases}${within ? `, ${within}` : ""}`;
  });
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
    if (seconds) node.textContent = `${seconds}\u202fs so far,`;
    setTimeout(tick, 1000);
  };
  tick();
}

// Labs and films are fetched when they come near the screen.
function watch(box) {
  const looking = new IntersectionObserver(async (entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    looking.disconnect();
    if (box.dataset.film) return stirred.then(() => import("./film.js")).then(({ openFilm }) => openFilm(box));
    const { openLab } = await import("./lab.js");
    const { lab: quiz, labId, labQuestion } = box.dataset;
    openLab(box, labQuestion ? { quiz, question: labQuestion } : { quiz, lab: labId });
  }, { rootMargin: "200px" });
  looking.observe(box);
}
