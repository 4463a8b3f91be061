// One question: its form, its latest verdict, and the lab that opens once a prediction is made.

import { atRest, awaitVerdict, post, submit } from "./api.js";
import { openLab } from "./lab.js";
import { showVerdict } from "./verdict.js";

const TYPING_MS = 300;
const WAITING = { queued: "Waiting for its turn…", running: "Your script is running…" };

export class Question {
  constructor(card, quiz, onVerdict) {
    this.card = card;
    this.quiz = quiz;
    this.id = card.dataset.question;
    this.kind = card.dataset.kind;
    this.onVerdict = onVerdict;
    this.form = card.querySelector("form");
    this.button = this.form.querySelector("button[type=submit]");
    this.progress = this.form.querySelector(".progress");
    this.box = card.querySelector(".verdict");
    this.form.addEventListener("submit", (event) => { event.preventDefault(); this.send(); });
    if (this.kind === "numeric") this.echoWhatIsTyped();
    this.button.disabled = false; // before this the browser would send the form itself
  }

  async answer() {
    const form = this.form;
    if (form.querySelector("fieldset.options")) {
      const chosen = form.querySelector("input[name=answer]:checked");
      return chosen ? Number(chosen.value) : missing("Choose one of the options first.");
    }
    const typed = form.elements.answer.value;
    if (this.kind !== "code") return typed.trim() ? typed : missing("Write an answer first.");
    const file = form.elements.file.files[0];
    if (file) return { source: await utf8(file) };
    return typed.trim() ? { source: typed } : missing("Choose a file or paste your script first.");
  }

  async send() {
    this.button.disabled = true;
    try {
      const answer = await this.answer();
      this.say("Sending…");
      await this.follow(await submit(this.quiz, this.id, answer));
      this.box.focus({ preventScroll: true });
      this.box.scrollIntoView({ block: "nearest" });
    } catch (error) {
      this.say(error.message, true);
    } finally {
      this.button.disabled = false;
    }
  }

  async follow(submission) {
    if (!atRest(submission)) {
      this.say(WAITING[submission.status] ?? WAITING.queued);
      submission = await awaitVerdict(submission, (status) => this.say(WAITING[status] ?? ""));
    }
    this.say("");
    this.show(submission);
  }

  show(submission) {
    showVerdict(this.box, submission);
    this.onVerdict();
    const lab = this.card.querySelector("[data-lab-of]");
    if (lab && !submission.withheld && submission.verdict.status !== "invalid_answer") openLab(lab, { quiz: this.quiz, question: this.id });
  }

  // After a reload: shows the newest submission, and follows it while it is being graded.
  async restore(submission) {
    try {
      await this.follow(submission);
    } catch (error) {
      this.say(error.message, true);
    }
  }

  tell(notice) {
    this.card.querySelector("[data-notice]").textContent = notice;
  }

  say(sentence, bad = false) {
    this.progress.textContent = sentence;
    this.progress.classList.toggle("bad", bad);
  }

  echoWhatIsTyped() {
    const input = this.form.elements.answer;
    const echo = this.form.querySelector(".read-as");
    let timer = 0, turn = 0;
    input.addEventListener("input", () => {
      clearTimeout(timer);
      const mine = ++turn;
      if (!input.value.trim()) return this.echo(echo, "", false);
      timer = setTimeout(async () => {
        const [sentence, bad] = await this.readAs(input.value);
        if (mine === turn) this.echo(echo, sentence, bad);
      }, TYPING_MS);
    });
  }

  async readAs(answer) {
    try {
      const understood = await post("/answers:validate", { quiz: this.quiz, question: this.id, answer });
      if (understood.read_as) return [`read as ${understood.read_as}`, false];
      return [understood.message ?? understood.diagnosis ?? "", true];
    } catch (error) {
      return [error.message, true];
    }
  }

  echo(node, sentence, bad) {
    node.textContent = sentence;
    node.classList.toggle("bad", bad);
  }
}

function missing(sentence) {
  throw new Error(sentence);
}

async function utf8(file) {
  const bytes = await file.arrayBuffer().catch(() => missing("This file has changed since you chose it; choose it again."));
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    throw new Error("This file is not UTF-8 text; save it as a plain .py file.");
  }
}
