// A verdict as HTML: status in plain words, points, diagnosis, findings, evidence, output, explanation.

import { setProse } from "./api.js";
import { el, number } from "./dom.js";
import { evidenceFigures } from "./evidence.js";

const WORDS = {
  correct: ["Correct", "good"],
  partial: ["Partly correct", "wait"],
  incorrect: ["Not correct", "bad"],
  needs_review: ["Received: an instructor will read it", "wait"],
  invalid_answer: ["This answer could not be read; it used up no attempt", "bad"],
  crashed: ["Your script ended with an error", "bad"],
  timed_out: ["Your script ran out of time", "bad"],
  out_of_memory: ["Your script ran out of memory", "bad"],
  output_too_large: ["Your script printed or returned too much", "bad"],
  forbidden: ["Your script tried something that is not allowed here", "bad"],
  grader_fault: ["The grader failed, not you; it used up no attempt", "wait"],
};

const wordsFor = (status) => (WORDS[status] ?? [status, "wait"])[0];
export const toneOf = (status) => (WORDS[status] ?? [status, "wait"])[1];

export function showVerdict(box, submission) {
  const verdict = submission.verdict;
  box.className = `verdict ${toneOf(verdict.status)}`;
  box.replaceChildren(...[
    head(submission, verdict),
    verdict.diagnosis ? el("p", { class: "diagnosis" }, verdict.diagnosis) : null,
    findingsTable(verdict.findings ?? [], Boolean(verdict.read_as)),
    pictures(evidenceFigures(verdict.evidence ?? {}, verdict.findings ?? [])),
    explanation(verdict.explain),
    output("What your script printed", verdict.stdout),
    output("What your script wrote to stderr", verdict.stderr),
  ].filter(Boolean));
  box.hidden = false;
}

function head(submission, verdict) {
  const decided = verdict.status !== "needs_review";
  const points = `${number(verdict.points)} of ${number(verdict.max_points)} point${verdict.max_points === 1 ? "" : "s"}`;
  return el("p", { class: "verdict-head" },
    el("strong", { "data-status": verdict.status }, submission.withheld && !decided ? "Received" : wordsFor(verdict.status)),
    decided ? el("span", {}, points) : null,
    verdict.read_as ? el("span", { class: "meta" }, `read as ${verdict.read_as}`) : null,
    submission.attempt ? el("span", { class: "meta" }, `attempt ${submission.attempt}`) : null);
}

// A typed answer needs no table: the measured value is the typed one.
function findingsTable(findings, typed) {
  const telling = findings.filter((finding) => finding.message || hasValue(finding.measured) || hasValue(finding.expected));
  if (!telling.length) return null;
  if (typed && telling.length === 1) return el("p", {}, telling[0].message);
  const shown = COLUMNS.filter(([key]) => telling.some((finding) => hasValue(finding[key])));
  const heading = (text, kind) => el("th", { scope: "col", class: kind }, text);
  return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Findings" }, el("table", { class: "findings" },
    el("thead", {}, el("tr", {}, heading("Result"), heading("Check"), shown.map(([, title]) => heading(title)), heading("Points", "number"))),
    el("tbody", {}, telling.map((finding) => row(finding, shown)))));
}

const COLUMNS = [["measured", "Measured"], ["expected", "Expected"]];
const PARTLY = ["partly", "wait"];
const MARKS = { true: ["passed", "good"], false: ["failed", "bad"], null: ["open", "wait"] };

function row(finding, shown) {
  const [mark, tone] = finding.passed === null && finding.points > 0 ? PARTLY : MARKS[String(finding.passed)];
  const empty = !shown.some(([key]) => hasValue(finding[key]));
  return el("tr", {},
    el("td", {}, el("span", { class: `mark ${tone}` }, mark)),
    el("td", { colspan: empty ? shown.length + 1 : null }, el("b", {}, finding.title), finding.message ? el("div", {}, finding.message) : null),
    empty ? null : shown.map(([key]) => el("td", {}, value(finding[key]))),
    el("td", { class: "number" }, `${number(finding.points, 3)} / ${number(finding.max_points, 3)}`));
}

const hasValue = (it) => it !== null && it !== undefined && it !== "";

function value(it) {
  if (!hasValue(it)) return "";
  if (Array.isArray(it)) return it.map(value).join(" to ");
  if (Array.isArray(it.rubric)) return el("ul", {}, it.rubric.map((item) => el("li", {}, `${item.title} (${number(item.points)})`)));
  if (typeof it === "object") return Object.entries(it).map(([key, one]) => `${key.replaceAll("_", " ")} ${value(one)}`).join(", ");
  return typeof it === "number" ? number(it, 5) : String(it);
}

function pictures(figures) {
  return figures.length ? el("details", { open: true }, el("summary", {}, "What was measured"), figures) : null;
}

function output(title, text) {
  if (!text?.trim()) return null;
  return el("details", { open: text.length < 2000 }, el("summary", {}, title), el("pre", { tabindex: 0 }, text));
}

function explanation(prose) {
  if (!prose) return null;
  const box = el("div", { class: "prose explanation" });
  setProse(box, prose);
  return box;
}
