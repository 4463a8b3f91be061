// What a learner has typed and not sent, in this browser's storage. The server's answer comes first: a draft that was
// begun before a newer answer is only offered. Another tab's draft shows here unless this tab's own field is in use.

const PREFIX = "draft:";

// Runs what may begin the browser's session alone: two at the same time would begin two, and one would be lost.
export const alone = (begin) => (navigator.locks ? navigator.locks.request("session", begin) : begin());

export class Drafts {
  constructor(learner) {
    this.begin(learner);
  }

  // Names the learner; drafts from before the session are the learner's from here on.
  begin(learner) {
    this.learner = learner;
    if (learner) this.adoptUnnamed();
  }

  key(form) { return `${PREFIX}${this.learner}:${form.dataset.answer}`; }

  // The name of the question whose draft another tab has changed.
  changed(event) {
    const start = `${PREFIX}${this.learner}:`;
    return event.key?.startsWith(start) ? event.key.slice(start.length) : null;
  }

  wasSent(event) { return read(event.newValue)?.sent !== undefined; }

  valueOf(form) {
    const field = form.elements.answer;
    if (!field) return null;
    return field.value ?? null; // of a group of radio buttons: the chosen one's, or ""
  }

  // The answer that the server has rendered.
  given(form) {
    const field = form.elements.answer;
    return field instanceof RadioNodeList ? Array.from(field).find((one) => one.defaultChecked)?.value ?? "" : field.defaultValue;
  }

  put(form, text) {
    const field = form.elements.answer;
    if (field instanceof RadioNodeList) for (const one of field) one.checked = one.value === text;
    else { field.value = text; field.dispatchEvent(new Event("change")); }
  }

  keep(form) {
    store(this.key(form), JSON.stringify({ text: this.valueOf(form), after: form.elements.after.value }));
    note(form, "not sent yet");
  }

  sent(form) {
    store(this.key(form), JSON.stringify({ sent: Date.now() }));
    note(form, "");
  }

  restore(form) {
    const draft = read(recall(this.key(form)));
    if (draft?.text === undefined || draft.text === null || draft.text === this.valueOf(form)) return note(form, "");
    if (draft.after === form.elements.after.value) {
      this.put(form, draft.text);
      note(form, "not sent yet");
    } else {
      this.offer(form, draft.text);
    }
  }

  mirror(form) {
    const draft = read(recall(this.key(form)));
    if (draft?.text === undefined || draft.text === null || draft.text === this.valueOf(form)) return;
    if (form.contains(document.activeElement) && document.hasFocus()) this.offer(form, draft.text);
    else { this.put(form, draft.text); note(form, "not sent, from another tab"); }
  }

  offer(form, text) {
    const node = note(form, "There is another draft. ");
    const button = document.createElement("button");
    button.type = "button";
    button.className = "link";
    button.textContent = "Show it";
    button.addEventListener("click", () => { this.put(form, text); this.keep(form); });
    node.append(button);
  }

  adoptUnnamed() {
    for (const key of keys()) {
      if (!key.startsWith(`${PREFIX}:`)) continue;
      const own = `${PREFIX}${this.learner}${key.slice(PREFIX.length)}`;
      const draft = read(recall(key));
      if (draft?.text !== undefined && recall(own) === null) store(own, JSON.stringify(draft));
      try { localStorage.removeItem(key); } catch { /* storage is closed */ }
    }
  }
}

function note(form, sentence) {
  let node = form.querySelector("[data-draft]");
  if (!node) {
    node = document.createElement("span");
    node.className = "meta";
    node.dataset.draft = "";
    form.querySelector(".actions")?.append(node);
  }
  node.textContent = sentence;
  return node;
}

// Storage may be closed or full: then nothing is kept, and the page works all the same.
function store(key, text) { try { localStorage.setItem(key, text); } catch { /* nothing to do */ } }
function recall(key) { try { return localStorage.getItem(key); } catch { return null; } }
function keys() { try { return Object.keys(localStorage); } catch { return []; } }
function read(text) { try { return JSON.parse(text); } catch { return null; } }
