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
    ...evidenceFigures(verdict.evidence ?? {}, verdict.findings ?? []),
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
    el("strong", { "data-status": verdict.status }, wordsFor(verdict.status)),
    decided ? el("span", {}, points) : null,
    verdict.read_as ? el("span", { class: "meta" }, `read as ${verdict.read_as}`) : null,
    submission.attempt ? el("span", { class: "meta" }, `attempt ${submission.attempt}`) : null);
}

// A typed answer needs no table: what was measured is what was typed.
function findingsTable(findings, typed) {
  const telling = findings.filter((finding) => finding.message || hasValue(finding.measured) || hasValue(finding.expected));
  if (!telling.length) return null;
  if (typed && telling.length === 1) return el("p", {}, telling[0].message);
  const measured = telling.some((finding) => hasValue(finding.measured));
  const expected = telling.some((finding) => hasValue(finding.expected));
  const heading = (text) => el("th", { scope: "col" }, text);
  return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Findings" }, el("table", {},
    el("thead", {}, el("tr", {}, heading("Check"), heading("Result"),
      measured ? heading("Measured") : null, expected ? heading("Expected") : null,
      el("th", { scope: "col", class: "number" }, "Points"))),
    el("tbody", {}, telling.map((finding) => row(finding, measured, expected)))));
}

function row(finding, measured, expected) {
  const [mark, tone] = { true: ["passed", "good"], false: ["failed", "bad"], null: ["open", "wait"] }[String(finding.passed)];
  return el("tr", {},
    el("td", {}, el("b", {}, finding.title), finding.message ? el("div", {}, finding.message) : null),
    el("td", {}, el("span", { class: `mark ${tone}` }, mark)),
    measured ? el("td", {}, value(finding.measured)) : null,
    expected ? el("td", {}, value(finding.expected)) : null,
    el("td", { class: "number" }, `${number(finding.points)} / ${number(finding.max_points)}`));
}

const hasValue = (it) => it !== null && it !== undefined && it !== "";

function value(it) {
  if (!hasValue(it)) return "";
  if (Array.isArray(it)) return it.map(value).join(" to ");
  if (typeof it === "object") return Object.entries(it).map(([key, one]) => `${key.replaceAll("_", " ")} ${value(one)}`).join(", ");
  return typeof it === "number" ? number(it, 5) : String(it);
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
