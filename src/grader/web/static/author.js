// The author's desk: saves without leaving the page, and shows every change of the folder as it happens.

import { offerCopies } from "./copy.js";

const desk = document.querySelector("[data-author]");
const form = document.querySelector("[data-source]");
const field = form.elements.source;
const trouble = form.querySelector("[data-trouble]");
const path = desk.dataset.author;
let saved = field.value;
let turn = 0; // of the newest refresh or save: what was fetched before it is old

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
  const sent = field.value;
  const response = await fetch(`/source/${path}`, { method: "PUT", body: sent, headers: { "If-Match": `"${form.elements.tag.value}"` } })
    .catch(() => null);
  if (response?.status === 204) {
    form.elements.tag.value = response.headers.get("ETag").replaceAll('"', "");
    saved = sent;
    turn += 1;
    say("Saved.");
    const moved = response.headers.get("Location"); // the question has another id now
    if (moved && !isChanged()) location.assign(moved);
    else await refresh();
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

// Of the file; what follows it in a tag says which part of the file is shown.
const digestOf = (tag) => tag.split("-")[0];

// Replaces what is shown by the page as it is now; what is typed and not saved stays.
async function refresh() {
  const mine = ++turn;
  const response = await fetch(location.pathname.startsWith("/edit/") ? location.href : `/edit/${path}`).catch(() => null);
  if (!response?.ok) return;
  const page = new DOMParser().parseFromString(await response.text(), "text/html");
  if (mine !== turn) return;
  document.querySelector("[data-shown]").replaceWith(page.querySelector("[data-shown]"));
  document.querySelectorAll("[data-lab]").forEach(watch);
  offerCopies(document.querySelector("[data-shown]"));
  desk.dataset.seen = page.querySelector("[data-author]").dataset.seen;
  const newer = page.querySelector("[data-source]").elements;
  // The file is as it was saved here: what is shown stays, even if the question cannot be found in it for the moment.
  if (digestOf(newer.tag.value) === digestOf(form.elements.tag.value)) return;
  if (!isChanged()) {
    if (field.value !== newer.source.value) field.value = newer.source.value;
    saved = field.value;
    form.elements.tag.value = newer.tag.value;
    form.querySelector("[for=source]").textContent = page.querySelector("[data-source] [for=source]").textContent;
  } else {
    say("The file has changed on the disk: copy what you typed, and read the page again.", true);
  }
}

async function follow() {
  for (;;) {
    const response = await fetch(`/changes/${path}?seen=${desk.dataset.seen}`).catch(() => null);
    if (!response?.ok) {
      say("grader author does not answer.", true);
      await new Promise((resolve) => setTimeout(resolve, 2000));
    } else if ((await response.json()).state !== desk.dataset.seen) {
      await refresh();
    }
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
