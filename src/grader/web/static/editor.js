// The code box as CodeMirror 6, over the textarea: that stays in the form and keeps the text, so that drafts, uploads and
// sending know nothing of the editor. It lives in a shadow root, where its styles need no exception of the security policy.

import {
  bracketMatching, Decoration, EditorState, EditorView, highlightActiveLine, HighlightStyle, history, historyKeymap,
  indentLess, indentMore, indentOnInput, indentUnit, insertNewlineAndIndent, keymap, lineNumbers, pythonLanguage, search, searchKeymap,
  standardKeymap, StateEffect, StateField, syntaxHighlighting, tags as t, toggleComment, WidgetType,
} from "./vendor/codemirror.js";

const LEAVING = "Tab indents. Escape, then Tab, leaves the code.";
const FROM_PAGE = "page";

// Colours are the page's own, so that light and dark follow it.
const COLOURS = HighlightStyle.define([
  { tag: [t.keyword, t.bool, t.null, t.self, t.operatorKeyword, t.controlKeyword, t.definitionKeyword, t.moduleKeyword], color: "var(--implicitfast)" },
  { tag: [t.string, t.special(t.string)], color: "var(--ok)" },
  { tag: t.number, color: "var(--part)" },
  { tag: t.comment, color: "var(--soft)", fontStyle: "italic" },
  { tag: [t.function(t.definition(t.variableName)), t.definition(t.className)], fontWeight: "600" },
]);

const LOOK = EditorView.theme({
  "&": { height: "100%", containerType: "inline-size", color: "var(--ink)", backgroundColor: "var(--card)", fontSize: "var(--small)" },
  "&.cm-focused": { outline: "0" },
  "&.cm-focused::after": { content: "''", position: "absolute", inset: "0", border: "2px solid var(--ink)", pointerEvents: "none", zIndex: "201" }, // above the line numbers
  ".cm-scroller": { fontFamily: "var(--mono)", lineHeight: "1.5", overscrollBehavior: "auto" },
  ".cm-content": { caretColor: "var(--ink)", padding: "var(--s2) 0" },
  ".cm-gutters": { backgroundColor: "var(--card)", color: "var(--soft)", border: "0" },
  ".cm-activeLine": { backgroundColor: "var(--sunk)" },
  "&.cm-focused .cm-matchingBracket, .cm-matchingBracket": { backgroundColor: "var(--sunk)", outline: "1px solid var(--edge)" },
  ".cm-nonmatchingBracket": { outline: "1px solid var(--no)" },
  ".cm-faulty": { backgroundColor: "var(--no-bg)", boxShadow: "inset 2px 0 var(--no)" },
  ".cm-said": {
    padding: "var(--s1) var(--s3)", borderLeft: "2px solid var(--no)", backgroundColor: "var(--no-bg)", color: "var(--ink)",
    fontFamily: "var(--sans)", whiteSpace: "normal", position: "sticky", left: "0", maxWidth: "min(40rem, 100cqi - 5rem)",
  },
  ".cm-panels": { backgroundColor: "var(--card)", color: "var(--ink)", fontFamily: "var(--sans)" },
  ".cm-panels-top": { borderBottom: "1px solid var(--line)" },
  ".cm-panel.cm-search": { padding: "var(--s2)", fontSize: "var(--small)" },
  ".cm-textfield, .cm-button": {
    font: "inherit", color: "var(--ink)", background: "var(--card)", border: "1px solid var(--edge)", borderRadius: "4px", padding: "2px var(--s2)",
  },
  ".cm-panel.cm-search [name=close]": { color: "var(--ink)", fontSize: "1.25rem", padding: "0 var(--s2)" },
  ".cm-searchMatch": { backgroundColor: "var(--part-bg)", outline: "1px solid var(--part)" },
  ".cm-leaving": { padding: "2px var(--s3)", fontSize: ".75rem", color: "var(--soft)" },
});

class Message extends WidgetType {
  constructor(text) { super(); this.text = text; }
  eq(other) { return other.text === this.text; }
  toDOM() {
    const node = document.createElement("div");
    node.className = "cm-said";
    node.textContent = this.text;
    return node;
  }
}

const say = StateEffect.define(); // { line, code, text }, or null
const said = StateField.define({
  create: () => Decoration.none,
  update(marks, change) {
    const effect = change.effects.find((candidate) => candidate.is(say));
    if (!effect) return marks.map(change.changes);
    const { line: number, code, text } = effect.value ?? {};
    if (!number || number > change.state.doc.lines) return Decoration.none;
    const line = change.state.doc.line(number);
    if (line.text.trim() !== code) return Decoration.none; // another script was loaded meanwhile
    return Decoration.set([
      Decoration.line({ class: "cm-faulty" }).range(line.from),
      Decoration.widget({ widget: new Message(text), block: true, side: 1 }).range(line.to),
    ]);
  },
  provide: (field) => EditorView.decorations.from(field),
});

// After Escape the next Tab leaves, as WCAG 2.1.2 asks; whatever is typed takes that back.
const leave = StateEffect.define();
const isLeaving = StateField.define({
  create: () => false,
  update: (value, change) => change.effects.some((effect) => effect.is(leave)) || (value && !change.docChanged && !change.selection),
});
const unlessLeaving = (command) => (view) => !view.state.field(isLeaving) && command(view);

const KEYS = keymap.of([
  ...searchKeymap, // Escape closes the search first
  { key: "Escape", run: (view) => { view.dispatch({ effects: leave.of(true) }); return false; } },
  { key: "Tab", run: unlessLeaving(indentMore), shift: unlessLeaving(indentLess) },
  { key: "Mod-/", run: toggleComment },
  { key: "Enter", run: insertNewlineAndIndent },
  ...historyKeymap, ...standardKeymap,
]);

export function openEditor(area) {
  const box = area.parentElement, host = document.createElement("div");
  const root = host.attachShadow({ mode: "open" });
  const view = new EditorView({
    doc: area.value, selection: { anchor: area.selectionStart, head: area.selectionEnd }, root, parent: root,
    extensions: [
      LOOK, keymap.of([{ key: "Mod-Enter", run: () => { area.form.requestSubmit(); return true; } }]), KEYS, said, isLeaving, lineNumbers(), history(), highlightActiveLine(), bracketMatching(), indentOnInput(), search({ top: true }),
      ...(area.dataset.takes === "mjcf" ? [indentUnit.of("  ")] : [pythonLanguage, syntaxHighlighting(COLOURS), indentUnit.of("    ")]), EditorState.tabSize.of(4), EditorState.readOnly.of(area.readOnly),
      EditorView.darkTheme.of(matchMedia("(prefers-color-scheme: dark)").matches),
      EditorView.contentAttributes.of({
        "aria-label": `${area.labels[0].textContent.trim()}, code`, "aria-description": LEAVING, tabindex: "0", spellcheck: "false", autocapitalize: "off", autocorrect: "off",
      }),
      EditorView.updateListener.of((update) => { if (update.docChanged && !update.transactions.some((change) => change.isUserEvent(FROM_PAGE))) write(); }),
    ],
  });

  const write = () => {
    area.value = view.state.doc.toString();
    area.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const read = () => {
    if (area.value === view.state.doc.toString()) return;
    view.dispatch({ changes: { from: 0, to: view.state.doc.length, insert: area.value }, userEvent: FROM_PAGE });
  };
  for (const name of ["input", "change"]) area.addEventListener(name, read);

  const hint = document.createElement("div");
  hint.className = "cm-leaving";
  hint.textContent = LEAVING;
  hint.hidden = true;
  view.dom.append(hint);
  view.contentDOM.addEventListener("focus", () => { hint.hidden = false; });
  view.contentDOM.addEventListener("blur", () => { hint.hidden = true; });

  host.className = "code-editor";
  box.style.position = "relative";
  Object.assign(host.style, { position: "absolute", inset: "0" });
  Object.assign(area.style, { opacity: "0", pointerEvents: "none" }); // it still gives the box its height
  host.addEventListener("input", (event) => event.stopPropagation()); // a search is no draft
  area.tabIndex = -1;
  area.setAttribute("aria-hidden", "true");
  const hadFocus = document.activeElement === area;
  box.append(host);
  if (hadFocus) view.focus();

  area.labels[0].addEventListener("click", (event) => { event.preventDefault(); view.focus(); });
  document.addEventListener("click", (event) => {
    const { goTo, intoEditor } = event.target.dataset ?? {};
    if (intoEditor !== undefined) queueMicrotask(() => view.focus());
    if (!goTo) return;
    event.preventDefault();
    event.stopImmediatePropagation(); // page.js would put the caret into the textarea
    showLine(view, Number(goTo));
  }, true);

  let last = "null";
  const tell = () => {
    const message = messageOn(document.getElementById("result")), now = JSON.stringify(message);
    if (now !== last) view.dispatch({ effects: say.of(message) });
    last = now;
  };
  new MutationObserver(tell).observe(box.closest(".work"), { childList: true, subtree: true }); // verdicts are put in place of others
  tell();
}

// The line that the verdict on the newest attempt marks, with its sentence; null without one.
function messageOn(result) {
  const marked = result.querySelector(".marked"), hot = marked?.querySelector(".hot");
  if (!hot || result.querySelector("[data-into-editor]")) return null; // an older attempt can be put into the editor
  const text = [...marked.querySelector(".margin").childNodes].filter((node) => node.className !== "hidden-text").map((node) => node.textContent).join("");
  return { line: Number(hot.dataset.line), code: hot.textContent.trim(), text: text.trim() };
}

function showLine(view, number) {
  const line = view.state.doc.line(Math.min(number, view.state.doc.lines));
  view.dispatch({ selection: { anchor: line.from }, effects: EditorView.scrollIntoView(line.from, { y: "center" }) });
  view.focus();
  view.dom.getRootNode().host.scrollIntoView({ block: "nearest" });
}
