// The student page: questions, their latest verdicts, and the lesson's labs.

import { get, latestOf } from "./api.js";
import { number } from "./dom.js";
import { openLab } from "./lab.js";
import { Question } from "./question.js";

for (const section of document.querySelectorAll("[data-quiz]")) start(section);

async function start(section) {
  const quiz = section.dataset.quiz;
  const score = section.querySelector("[data-score]");
  const questions = Array.from(section.querySelectorAll("[data-question]"),
    (card) => new Question(card, quiz, () => refresh(quiz, questions, score)));
  for (const lab of section.querySelectorAll("[data-lab]")) openLab(lab, { quiz, lab: lab.dataset.lab });
  if (questions.length && document.body.dataset.learner) await restore(quiz, questions, score);
}

async function restore(quiz, questions, score) {
  try {
    const latest = await latestOf(quiz, document.body.dataset.learner, questions.length);
    for (const question of questions) {
      if (latest.has(question.id)) question.restore(latest.get(question.id));
    }
  } catch (error) {
    score.textContent = error.message;
  }
}

// Points and attempts left come from the server; verdicts that arrive together cause one request.
const waiting = new Map();

function refresh(quiz, questions, score) {
  clearTimeout(waiting.get(quiz));
  waiting.set(quiz, setTimeout(() => refreshNow(quiz, questions, score), 50));
}

async function refreshNow(quiz, questions, score) {
  try {
    const shown = (await get(`/quizzes/${encodeURIComponent(quiz)}`)).questions;
    const results = shown.map((one) => one.result).filter(Boolean);
    const sum = (numbers) => numbers.reduce((total, one) => total + one, 0);
    const total = sum(shown.map((one) => one.points));
    score.textContent = results.length ? `${number(sum(results.map((one) => one.points)))} of ${number(total)} points` : "";
    for (const question of questions) question.tell(shown.find((one) => one.id === question.id)?.notice ?? "");
  } catch (error) {
    score.textContent = error.message;
  }
}
