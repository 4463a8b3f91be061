// The statistics of a quiz as a table: one row for each question.

import { get } from "./api.js";
import { el, number } from "./dom.js";

const [box, progress] = ["measured", "measuring"].map((name) => document.querySelector(`[data-${name}]`));

for (const button of document.querySelectorAll("[data-statistics]")) {
  button.addEventListener("click", () => show(button.dataset.statistics));
}

async function show(quiz) {
  progress.textContent = "Counting…";
  try {
    const { learners, questions } = await get(`/quizzes/${encodeURIComponent(quiz)}/statistics`);
    progress.textContent = `${learners} learner${learners === 1 ? "" : "s"} of ${quiz}`;
    box.replaceChildren(table(quiz, questions));
  } catch (error) {
    progress.textContent = error.message;
  }
}

const COLUMNS = ["Question", "Difficulty", "Right at once", "Discrimination", "Options chosen first", "Wrong numbers", "Mistakes"];

function table(quiz, questions) {
  return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `Statistics of ${quiz}` }, el("table", {},
    el("thead", {}, el("tr", {}, COLUMNS.map((name) => el("th", { scope: "col" }, name)))),
    el("tbody", {}, questions.map(row))));
}

function row(one) {
  return el("tr", {},
    el("td", {}, one.question),
    el("td", {}, estimate(one.difficulty)),
    el("td", {}, estimate(one.right_at_once)),
    el("td", {}, estimate(one.discrimination)),
    el("td", {}, one.options.map(({ option, learners }) => `${option + 1}: ${learners}`).join(", ")),
    el("td", {}, lines(one.clusters.map(({ value, learners }) => `${number(value, 4)}: ${learners}`))),
    el("td", {}, lines(one.mistakes.map(({ diagnosis, learners }) => `${learners} × ${diagnosis}`))));
}

// The value, its 95 % interval and the number of learners.
function estimate(one) {
  return one ? `${number(one.value, 2)} (${number(one.low, 2)} to ${number(one.high, 2)}, n = ${one.n})` : "";
}

const lines = (texts) => texts.map((text) => el("div", {}, text));
