// The student page: questions, their latest verdicts, and the lesson's labs.

import { latestOf } from "./api.js";
import { number } from "./dom.js";
import { openLab } from "./lab.js";
import { Question } from "./question.js";

const UNCOUNTED = ["invalid_answer", "grader_fault"];

for (const section of document.querySelectorAll("[data-quiz]")) start(section);

async function start(section) {
  const quiz = section.dataset.quiz;
  const points = new Map();
  const score = section.querySelector("[data-score]");
  const questions = Array.from(section.querySelectorAll("[data-question]"), (card) => new Question(card, quiz, (question, submission) => {
    if (UNCOUNTED.includes(submission.verdict.status)) return;
    points.set(question.id, submission.verdict.points);
    const total = questions.reduce((sum, one) => sum + Number(one.card.dataset.points), 0);
    const reached = Array.from(points.values()).reduce((sum, one) => sum + one, 0);
    score.textContent = `${number(reached)} of ${number(total)} points`;
  }));
  for (const lab of section.querySelectorAll("[data-lab]")) openLab(lab, { quiz, lab: lab.dataset.lab });
  if (questions.length) await restore(quiz, questions, score);
}

async function restore(quiz, questions, score) {
  try {
    const latest = await latestOf(quiz, document.body.dataset.user, questions.length);
    for (const question of questions) {
      if (latest.has(question.id)) question.restore(latest.get(question.id));
    }
  } catch (error) {
    score.textContent = error.message;
  }
}
