// The author's desk: saves without leaving the page, and shows every change of the folder as it happens.

import { offerCopies } from "./copy.js";

const desk = document.querySelector("[data-author]");
const form = document.querySelector("[data-source]");
const field = form.elements.source;
const trouble = form.querySelector("[data-trouble]");
let path = desk.dataset.author; // another one once the question is saved with another id
let saved = field.value;
let isSaving = false, isWanted = false; // one save at a time; whether another is asked for meanwhile
let isGone = false;
let turn = 0; // of the newest refresh or save: what was fetched before it is old

const CHANGED = "The file has changed on the disk: copy what you typed, and read the page again.";
const GONE = "The file holds no such question any more: it was deleted, or has another id now. Nothing of it can be saved here: copy what you need.";

const isChanged = () => field.value !== saved;

function say(text, isBad = false) {
  trouble.textContent = text;
  trouble.classList.toggle("bad", isBad);
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  save();
});

addEventListener("keydown", (event) => {
  if ((event.ctrlKey || event.metaKey) && event.key === "s") {
    event.preventDefault();
    if (form.querySelector("[data-download]")) download();
    else save();
  }
});

addEventListener("beforeunload", (event) => {
  if (isChanged()) event.preventDefault();
});

async function save() {
  isWanted = true;
  if (isSaving) return;
  isSaving = true;
  try {
    for (let isFirst = true; isWanted && (isFirst || isChanged()); isFirst = false) {
      isWanted = false;
      await send();
    }
  } finally {
    isSaving = isWanted = false;
  }
}

async function send() {
  const sent = field.value;
  const response = await fetch(`/source/${path}`, { method: "PUT", body: sent, headers: { "If-Match": `"${form.elements.tag.value}"` } })
    .catch(() => null);
  if (response?.status === 204) {
    form.elements.tag.value = response.headers.get("ETag").replaceAll('"', "");
    saved = sent;
    turn += 1;
    say("Saved.");
    const moved = response.headers.get("Location"); // the question has another id now
    if (moved) {
      path = moved.replace("/edit/", "");
      history.replaceState(null, "", moved);
    }
    if (path !== desk.dataset.author && !isChanged()) location.reload();
    else refresh(); // what is typed meanwhile stays
  } else if (response?.status === 404) {
    say(GONE, true);
  } else {
    say([412, 413].includes(response?.status) ? (await response.json()).why : "Nothing was saved: does grader author still run?", true);
  }
}

form.querySelector("[data-download]")?.addEventListener("click", download);

function download() {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([field.value], { type: "application/json" }));
  link.download = form.querySelector("[data-download]").dataset.download.split("/").pop();
  link.click();
  URL.revokeObjectURL(link.href);
}

// Of the whole file; what follows it in a tag says which part of the file is shown.
const digestOf = (tag) => tag.split("-")[0];

// Replaces what is shown by the page as it is now; what is typed and not saved stays.
async function refresh() {
  const mine = ++turn;
  const address = new URL(location.pathname.startsWith("/edit/") ? location.href : `/edit/${path}`, location.href);
  address.searchParams.set("shown", form.elements.tag.value);
  const response = await fetch(address).catch(() => null);
  const text = await response?.text();
  if (mine !== turn || isSaving) return; // a save leads here again
  const wasGone = isGone;
  isGone = response?.status === 404;
  if (isGone !== wasGone) say(isGone ? GONE : "", isGone);
  if (!response?.ok) return;
  const page = new DOMParser().parseFromString(text, "text/html");
  document.querySelector("[data-shown]").replaceWith(page.querySelector("[data-shown]"));
  document.querySelectorAll("[data-lab]").forEach(watch);
  offerCopies(document.querySelector("[data-shown]"));
  desk.dataset.seen = page.querySelector("[data-author]").dataset.seen;
  const [list, newList] = [document, page].map((one) => one.querySelector("[data-questions]"));
  // While the file cannot be read, its questions are not in the new list.
  if (newList.querySelector("[aria-current]") && list.innerHTML !== newList.innerHTML) list.replaceWith(newList);
  const newer = page.querySelector("[data-source]").elements;
  const [label, newLabel] = [document, page].map((one) => one.querySelector("[data-source] [for=source]"));
  // The file is as it was saved here: what is shown stays, even if the question cannot be found in it for the moment.
  if (digestOf(newer.tag.value) === digestOf(form.elements.tag.value)) {
    label.textContent = newLabel.textContent;
  } else if (!isChanged()) {
    if (field.value !== newer.source.value) field.value = newer.source.value;
    saved = field.value;
    form.elements.tag.value = newer.tag.value;
    label.textContent = newLabel.textContent;
  } else if (newer.source.value.trim() === saved.trim()) { // it has changed elsewhere
    form.elements.tag.value = newer.tag.value;
    if (trouble.textContent === CHANGED) say("");
  } else {
    say(CHANGED, true);
  }
}

async function follow() {
  for (;;) {
    const response = await fetch(`/changes/${path}?seen=${desk.dataset.seen}`).catch(() => null);
    if (!response?.ok) {
      say("grader author does not answer.", true);
      await new Promise((resolve) => setTimeout(resolve, 2000));
      continue;
    }
    const { state } = await response.json();
    if (state === desk.dataset.seen) continue;
    await refresh();
    if (isGone) desk.dataset.seen = state; // there is no page to say what it has seen
  }
}

// Labs are fetched when they come near the screen, as on the page of a lesson.
function watch(box) {
  const looking = new IntersectionObserver(async (entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    looking.disconnect();
    const { openLab } = await import("./lab.js");
    openLab(box, { quiz: box.dataset.lab, question: box.dataset.labQuestion });
  }, { rootMargin: "200px" });
  looking.observe(box);
}

document.querySelectorAll("[data-lab]").forEach(watch);
follow();
