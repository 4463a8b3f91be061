// What a learner has typed and not sent. The server's answer comes first: a draft that was begun before a newer answer
// is only offered. Another tab's draft shows here where this tab has none of its own.

const PREFIX = "draft:";
const ALL_TABS = "localStorage", THIS_TAB = "sessionStorage";
const ANSWER = /^answer(\.|$)/; // the names of the fields that belong to the answer

// Runs what may begin the browser's session alone: two at the same time would begin two, and one would be lost.
export const alone = (begin) => (navigator.locks ? navigator.locks.request("session", begin) : begin());

export class Drafts {
  constructor(learner) {
    this.begin(learner);
  }

  // Drafts from before the session are the learner's from here on.
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

  // The values of the answer's fields, by name: of boxes and radio buttons the checked ones.
  valueOf(form) {
    return grouped(controls(form).filter((control) => !isBox(control) || control.checked).map(({ name, value }) => [name, value]));
  }

  // The answer that the server has rendered.
  given(form) {
    return grouped(controls(form).filter((control) => !isBox(control) || control.defaultChecked).map((control) => [control.name, defaultOf(control)]));
  }

  put(form, fields) {
    const left = new Map(Object.entries(fields).map(([name, values]) => [name, [...values]]));
    for (const control of controls(form)) {
      if (isBox(control)) control.checked = fields[control.name]?.includes(control.value) ?? false;
      else { control.value = left.get(control.name)?.shift() ?? ""; control.dispatchEvent(new Event("change")); }
    }
  }

  // Keeps what was typed after the answer `after`.
  keep(form, after = form.elements.after.value) {
    const draft = JSON.stringify({ fields: this.valueOf(form), after, at: Date.now() });
    for (const where of [ALL_TABS, THIS_TAB]) store(this.key(form), draft, where);
    note(form, "not sent yet");
  }

  sent(form) {
    store(this.key(form), JSON.stringify({ sent: Date.now() }));
    remove(this.key(form), THIS_TAB);
    note(form, "");
  }

  restore(form) {
    const [draft, own] = [ALL_TABS, THIS_TAB].map((where) => read(recall(this.key(form), where)));
    if (!draft && !this.learner) return this.offerEarlier(form);
    if (own?.fields && draft && !same(own.fields, draft.fields)) {
      if (own.after !== form.elements.after.value) return this.offer(form, own.fields);
      this.put(form, own.fields);
      return draft.fields ? this.offer(form, draft.fields) : note(form, "not sent yet");
    }
    if (!draft?.fields || same(draft.fields, this.valueOf(form))) return note(form, "");
    if (draft.after === form.elements.after.value) {
      this.put(form, draft.fields);
      note(form, "not sent yet");
    } else {
      this.offer(form, draft.fields);
    }
  }

  mirror(form, { oldValue, newValue }) {
    const [before, draft] = [oldValue, newValue].map(read), shown = this.valueOf(form);
    if (!draft?.fields || same(draft.fields, shown)) return;
    const follows = same(shown, before?.fields) || same(shown, this.given(form));
    if (!follows || (form.contains(document.activeElement) && document.hasFocus())) return this.offer(form, draft.fields);
    this.put(form, draft.fields);
    remove(this.key(form), THIS_TAB);
    note(form, "not sent, from another tab");
  }

  // After a session the newest draft of whoever had it is offered.
  offerEarlier(form) {
    const drafts = keys().filter((key) => key.startsWith(PREFIX) && key.endsWith(`:${form.dataset.answer}`)).map((key) => read(recall(key)));
    const [newest] = drafts.filter((draft) => draft?.fields).sort((one, other) => (other.at ?? 0) - (one.at ?? 0));
    if (newest) this.offer(form, newest.fields, "Your session has ended; a draft is kept in this browser. ");
  }

  offer(form, fields, why = "There is another draft. ") {
    const node = note(form, why);
    const button = document.createElement("button");
    button.type = "button";
    button.className = "link";
    button.textContent = "Show it";
    button.addEventListener("click", () => { this.put(form, fields); this.keep(form); });
    node.append(button);
  }

  adoptUnnamed() {
    for (const key of keys()) {
      if (!key.startsWith(`${PREFIX}:`)) continue;
      const own = `${PREFIX}${this.learner}${key.slice(PREFIX.length)}`;
      const draft = read(recall(key));
      if (draft?.fields && recall(own) === null) store(own, JSON.stringify(draft));
      remove(key);
    }
  }
}

// Whether two answers are the same, whatever the line ends and the order of the fields.
export const same = (one, other) => written(one) === written(other);

function written(fields) {
  return JSON.stringify(Object.entries(fields ?? {}).sort(([a], [b]) => (a < b ? -1 : 1))).replaceAll("\\r\\n", "\\n");
}

function grouped(pairs) {
  const fields = {};
  for (const [name, value] of pairs) (fields[name] ??= []).push(value);
  return fields;
}

const controls = (form) => Array.from(form.elements).filter((control) => ANSWER.test(control.name ?? "") && control.type !== "file"); // no script may choose a file
const isBox = (control) => control.type === "radio" || control.type === "checkbox";

// What a control held when the page was loaded.
function defaultOf(control) {
  if (control.tagName !== "SELECT") return control.defaultValue;
  return (Array.from(control.options).find((option) => option.defaultSelected) ?? control.options[0])?.value ?? "";
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

// Storage may be closed or full: the page works all the same.
function store(key, text, where = ALL_TABS) { try { window[where].setItem(key, text); } catch { /* nothing to do */ } }
function recall(key, where = ALL_TABS) { try { return window[where].getItem(key); } catch { return null; } }
function remove(key, where = ALL_TABS) { try { window[where].removeItem(key); } catch { /* nothing to do */ } }
function keys() { try { return Object.keys(localStorage); } catch { return []; } }

// A draft in storage; earlier ones have the text of the one field.
function read(text) {
  try {
    const draft = JSON.parse(text);
    return typeof draft?.text === "string" ? { ...draft, fields: { answer: [draft.text] } } : draft;
  } catch {
    return null;
  }
}
