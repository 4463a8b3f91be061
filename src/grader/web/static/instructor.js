// The instructor page: the table of submissions; a row opens the submission under the table, with the form of its review.

import { get } from "./api.js";
import { el, number } from "./dom.js";
import "./statistics.js";
import { closeReview, openReview } from "./review.js";
import { showVerdict, toneOf } from "./verdict.js";

const find = (name) => document.querySelector(`[data-${name}]`);
const [filters, status, rows, more, one] = ["filters", "status", "submissions", "more", "one"].map(find);
let cursor = null;

filters.addEventListener("submit", (event) => { event.preventDefault(); load(true); });
more.addEventListener("click", () => load(false));
find("certify").addEventListener("click", certify);
find("certify").disabled = find("show").disabled = false; // a click before this would be lost
load(true);

async function certify() {
  const [button, progress, table] = ["certify", "certifying", "certificates"].map(find);
  button.disabled = true;
  progress.textContent = "Simulating…";
  try {
    const response = await fetch("/instructor/certificates");
    if (!response.ok) throw new Error();
    table.innerHTML = await response.text(); // our own table: everything in it was escaped by the server
    progress.textContent = "";
  } catch {
    progress.textContent = "The keys could not be checked. Reload this page and try again.";
  }
  button.disabled = false;
}

async function load(afresh) {
  const query = new URLSearchParams({ limit: 50 });
  const { which, ...wanted } = Object.fromEntries(new FormData(filters));
  for (const [name, value] of Object.entries(wanted)) if (value.trim()) query.set(name, value.trim());
  if (!afresh && cursor) query.set("cursor", cursor);
  try {
    const page = await get(`/${which}?${query}`);
    if (afresh) rows.replaceChildren();
    rows.append(...page.items.map(row));
    cursor = page.next_cursor;
    more.hidden = !cursor;
    status.textContent = rows.children.length ? "" : "Nothing yet.";
  } catch (error) {
    status.textContent = error.message;
  }
}

function row(submission) {
  const { verdict } = submission;
  const when = new Date(submission.created_at);
  const open = el("button", { type: "button", class: "link", onclick: () => show(submission.id) }, `${submission.quiz} ${submission.question}`);
  return el("tr", {},
    el("td", {}, el("time", { datetime: submission.created_at }, when.toLocaleString())),
    el("td", {}, submission.user),
    el("td", {}, open),
    el("td", {}, verdict ? el("span", { class: `mark ${toneOf(verdict.status)}` }, verdict.status.replaceAll("_", " ")) : submission.status),
    el("td", { class: "number" }, verdict ? `${number(verdict.points)} / ${number(verdict.max_points)}` : ""));
}

async function show(id) {
  try {
    const submission = await get(`/submissions/${encodeURIComponent(id)}`);
    closeReview();
    if (!submission.verdict) return;
    draw(submission);
    one.focus({ preventScroll: true });
    one.scrollIntoView({ block: "start" });
    await openReview(submission, (decided) => { draw(decided); load(true); });
  } catch (error) {
    status.textContent = error.message;
  }
}

function draw(submission) {
  showVerdict(one, submission);
  one.prepend(el("h3", {}, `${submission.user}: ${submission.quiz} ${submission.question}`), answer(submission.answer));
}

function answer(given) {
  const text = typeof given === "object" && given !== null ? given.source : String(given);
  return el("pre", { tabindex: 0, "aria-label": "Answer" }, text);
}
