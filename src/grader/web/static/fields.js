// The fields of a form: how what is typed is read, and a file whose text becomes the answer.

import { post } from "./api.js";
import { same } from "./drafts.js";

const TYPING_MS = 300;
const MINUS = /(?<![\w.-])-(?=\d)/g; // as the card of an answer writes it

const timers = new WeakMap();

// Says how a number is read while it is typed, until the form is sent.
export function echo(form, { drafts, tell, buttonOf, OFFLINE }) {
  clearTimeout(timers.get(form));
  const typed = drafts.valueOf(form);
  if (Object.values(typed).flat().some((value) => !value.trim())) return tell(form, "");
  const parts = Object.entries(typed).map(([name, [value]]) => [name.slice("answer.".length), value]);
  const answer = typed.answer?.[0] ?? Object.fromEntries(parts);
  const isOver = () => !same(drafts.valueOf(form), typed) || buttonOf(form).disabled;
  timers.set(form, setTimeout(async () => {
    const [quiz, question] = form.dataset.answer.split("/");
    try {
      const understood = await post("/answers:validate", { quiz, question, answer });
      if (!isOver()) tell(form, understood.valid ? `read as ${understood.read_as.replace(MINUS, "−")}` : understood.message, !understood.valid);
    } catch (error) {
      if (!isOver()) tell(form, error.status ? error.message : OFFLINE, true, false);
    }
  }, TYPING_MS));
}

const NOTEBOOK = /^\s*\{[^]*"nbformat"/;
const NO_SCRIPT = "This is a notebook: load its code alone, which Jupyter saves with File, Save and Export Notebook As, Executable Script.";

export async function load(form, input, { drafts, tell }) {
  const [file] = input.files;
  if (!file) return;
  try {
    const text = new TextDecoder("utf-8", { fatal: true }).decode(await file.arrayBuffer());
    if (text.includes("\0")) throw new TypeError(`${file.name} is no text`);
    if (NOTEBOOK.test(text)) tell(form, NO_SCRIPT, true);
    else {
      drafts.put(form, { answer: [text] });
      drafts.keep(form);
      tell(form, `${file.name} is loaded; not handed in yet.`);
    }
  } catch {
    tell(form, "This file is not UTF-8 text; save it as plain text.", true);
  }
  input.value = "";
}
