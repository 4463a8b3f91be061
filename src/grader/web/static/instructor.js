// The desk: the list of answers; a row opens the answer, as the server renders it, and the form of its review.

import { get, post } from "./api.js";
import { el, number } from "./dom.js";
import { closeReview, openReview } from "./review.js";

const find = (name) => document.querySelector(`[data-${name}]`);
const [filters, status, rows, more, one] = ["filters", "status", "submissions", "more", "one"].map(find);
const PATHS = { submissions: "/submissions?", reviews: "/reviews?", second: "/reviews?second=true&", disagreements: "/reviews/disagreements?" };
const TONES = { correct: "ok", partial: "part", needs_review: "wait", grader_fault: "wait" };
let cursor = null;
let shown = "submissions"; // which list the table holds

filters.addEventListener("submit", (event) => { event.preventDefault(); load(true); });
more.addEventListener("click", () => load(false));
find("show").disabled = false; // a click before this would be lost
load(true);

async function load(afresh) {
  const query = new URLSearchParams({ limit: 50 });
  const { which, ...wanted } = Object.fromEntries(new FormData(filters));
  for (const [name, value] of Object.entries(wanted)) if (value.trim()) query.set(name, value.trim());
  if (!afresh && cursor) query.set("cursor", cursor);
  try {
    const page = await get(PATHS[which] + query);
    if (afresh) rows.replaceChildren();
    shown = which;
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
  const open = el("button", { type: "button", class: "link", onclick: () => show(submission.id, submission) }, `${submission.quiz} ${submission.question}`);
  return el("tr", {},
    el("td", {}, el("time", { datetime: submission.created_at }, when.toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" }))),
    el("td", {}, submission.user),
    el("td", {}, open),
    el("td", {}, verdict ? el("span", { class: `mark ${TONES[verdict.status] ?? "no"}` }, verdict.status.replaceAll("_", " ")) : submission.status),
    el("td", { class: "number" }, verdict ? `${number(verdict.points)} / ${number(verdict.max_points)}` : ""));
}

// `listed` is the row of the list; that of a disagreement holds the two marks.
async function show(id, listed = {}) {
  try {
    const submission = await get(`/submissions/${encodeURIComponent(id)}`);
    await closeReview();
    if (!submission.verdict) return;
    await draw(id);
    one.focus({ preventScroll: true });
    one.scrollIntoView({ block: "start" });
    await openReview(submission, listed, shown === "second", decided);
  } catch (error) {
    status.textContent = error.message;
  }
}

async function decided(submission, next) {
  if (submission && !next) await draw(submission.id);
  await load(true);
  if (next) await openNext();
}

async function openNext() {
  if (shown === "disagreements") {
    rows.querySelector("button")?.click();
    return;
  }
  try {
    const [quiz, question] = [filters.quiz.value, filters.question.value.trim()];
    const claimed = await post("/reviews:claim", { ...(quiz ? { quiz } : {}), ...(quiz && question ? { question } : {}), second: shown === "second" });
    await show(claimed.id);
  } catch (error) {
    status.textContent = error.message;
  }
}

async function draw(id) {
  const response = await fetch(`/instructor/review/${encodeURIComponent(id)}`);
  if (!response.ok) throw new Error("This answer could not be shown. Reload this page.");
  one.innerHTML = await response.text(); // our own page: everything in it was escaped by the server
  one.hidden = false;
}
