// A lab on the page: the script of its kind draws what the server's runs return.

import { get, post } from "./api.js";

// target: {quiz, question} once the learner has predicted, or {quiz, lab}. Opens once.
export async function openLab(box, target) {
  if (box.dataset.open) return;
  box.dataset.open = "yes";
  const tell = (sentence, isBad = false) => {
    const message = box.querySelector("[data-message]");
    message.textContent = sentence;
    message.classList.toggle("no", isBad);
  };
  try {
    const [quiz, kind] = await Promise.all([get(`/quizzes/${encodeURIComponent(target.quiz)}`), import(`./labs/${box.dataset.form}.js`)]);
    const lab = target.lab ? quiz.labs.find(({ id }) => id === target.lab) : quiz.questions.find(({ id }) => id === target.question).lab;
    const run = (controls, more = {}) => post("/labs:run", { ...target, ...more, controls });
    kind.open(box, { lab, run, tell });
  } catch (error) {
    tell(error.message, true);
  }
}
