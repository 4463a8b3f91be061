// A review: opening the form claims the submission; If-Match guards against changes since then.

import { get, post, request, tagged } from "./api.js";
import { el, number } from "./dom.js";

const HEARTBEAT_MS = 5 * 60_000;

const form = document.querySelector("[data-review]");
const find = (name) => form.querySelector(`[data-${name}]`);
const [progress, rubric, marks] = ["deciding", "rubric", "marks"].map(find);
const buttons = form.querySelectorAll("[type=submit]");
let seen = null;

form.addEventListener("submit", (event) => { event.preventDefault(); decide(event.submitter === find("next")); });
document.addEventListener("keydown", onKey);
find("insert").addEventListener("click", insert);
find("save").addEventListener("click", () => changeSaved("POST", "", { ...seen.at, text: form.comment.value }));
find("replace").addEventListener("click", () => changeSaved("PUT", `/${form.saved.value}`, { text: form.comment.value }));
find("forget").addEventListener("click", () => changeSaved("DELETE", `/${form.saved.value}`));

export async function closeReview() {
  if (!seen) return;
  const { id, held, beat } = seen;
  clearInterval(beat);
  form.hidden = true;
  seen = null;
  if (held) await post("/reviews:release", { submission_id: id }).catch(() => {}); // it expires by itself
}

// Claims what waits; any other verdict may be reviewed too, without a claim.
export async function openReview(submission, listed, second, onDecided) {
  const { id, quiz, question, verdict } = submission;
  const held = second || Boolean(listed.second) || submission.status === "needs_review";
  const path = `/submissions/${encodeURIComponent(id)}`;
  const claim = { submission_id: id, second };
  const { body, etag } = await (held ? tagged("POST", "/reviews:claim", claim) : tagged("GET", `${path}/review`));
  seen = { id, at: { quiz, question }, path: `${path}/review${second ? "/second" : ""}`, etag, second, held, onDecided };
  if (held) seen.beat = setInterval(heartbeat, HEARTBEAT_MS);
  form.reset();
  showRubric(body.rubric, verdict);
  showMarks(listed);
  showSaved(body.comments);
  progress.textContent = held ? yours(body.claim) : "";
  form.hidden = false;
}

const yours = (claim) => `Yours until ${new Date(claim.expires_at).toLocaleTimeString(undefined, { timeStyle: "short" })}: nobody else can decide meanwhile.`;

async function heartbeat() {
  try {
    progress.textContent = yours(await post("/reviews:heartbeat", { submission_id: seen.id }));
  } catch (error) {
    clearInterval(seen?.beat);
    progress.textContent = error.message;
  }
}

// Items to tick; their sum stands in the empty field of the points, which wins where it is filled in.
function showRubric(items, verdict) {
  const review = verdict.findings.find((finding) => finding.id === "review");
  const ticked = new Set(review?.measured?.rubric?.map((item) => item.id));
  let group = null;
  rubric.replaceChildren(rubric.querySelector("legend"), ...items.flatMap((item, index) => {
    const heading = item.group && item.group !== group ? el("p", { class: "meta" }, item.group) : null;
    group = item.group;
    const key = index < 9 ? el("kbd", {}, String(index + 1)) : el("span");
    const box = el("input", { type: "checkbox", name: "item", value: item.id, checked: ticked.has(item.id), onchange: sum });
    box.dataset.points = item.points;
    return [heading, el("label", {}, key, box, el("span", {}, item.title), el("span", { class: "meta" }, number(item.points)))].filter(Boolean);
  }));
  rubric.hidden = !items.length;
  form.points.max = verdict.max_points;
  form.points.required = !items.length;
  const byHand = review && (!items.length || !ticked.size || review.measured.by_hand);
  form.points.value = byHand ? verdict.points : "";
  sum();
}

const boxes = () => [...rubric.querySelectorAll("input")];
const ticks = () => boxes().filter((box) => box.checked);

function sum() {
  const points = ticks().reduce((total, box) => total + Number(box.dataset.points), 0);
  form.points.placeholder = rubric.hidden ? "" : number(Math.min(Math.max(points, 0), Number(form.points.max)));
}

function showMarks({ first, second }) {
  marks.hidden = !second;
  if (!second) return;
  const said = second.comment ? `: ${second.comment}` : ".";
  marks.textContent = `${first.by} gave ${number(first.points)}, ${second.by} gave ${number(second.points)}${said}`;
}

function showSaved(comments) {
  form.saved.replaceChildren(...comments.map((one) => el("option", { value: one.id }, one.text)));
  for (const name of ["insert", "replace", "forget"]) find(name).disabled = !comments.length;
}

function insert() {
  const text = form.saved.selectedOptions[0]?.textContent ?? "";
  form.comment.value = [form.comment.value.trim(), text].filter(Boolean).join("\n");
  form.comment.focus();
}

async function changeSaved(method, which, body) {
  const at = seen.at;
  try {
    await request(method, `/reviews/comments${which}`, body);
    showSaved((await get(`/reviews/comments?${new URLSearchParams(at)}`)).items);
    progress.textContent = "The saved comments have changed.";
  } catch (error) {
    progress.textContent = error.message;
  }
}

// 1 to 9 tick items, Enter decides and goes on: where the key means nothing else.
function onKey(event) {
  if (!seen || event.altKey || event.metaKey || event.repeat) return;
  const inText = event.target.matches("input:not([type=checkbox]), textarea, select");
  if (event.key === "Enter" && (event.ctrlKey || !event.target.closest("a, button, summary, input, textarea, select"))) {
    event.preventDefault();
    form.requestSubmit(find("next"));
  } else if (!inText && !event.ctrlKey && /^[1-9]$/.test(event.key)) {
    boxes()[Number(event.key) - 1]?.click();
  }
}

function decision() {
  const given = form.points.value === "" ? {} : { points: Number(form.points.value) };
  const ticked = ticks().map((box) => box.value);
  if (!rubric.hidden && (ticked.length || !("points" in given))) given.rubric = ticked;
  return { ...given, comment: form.comment.value };
}

async function decide(next) {
  const { path, etag, second, onDecided } = seen;
  for (const button of buttons) button.disabled = true;
  progress.textContent = "Saving…";
  try {
    const { body, etag: newer } = await tagged("PUT", path, decision(), { "If-Match": etag });
    clearInterval(seen.beat);
    seen.held = false;
    seen.etag = newer;
    progress.textContent = second ? secondSaid(body) : "Decided. The learner sees it as soon as the quiz allows.";
    await onDecided(second ? null : body, next);
  } catch (error) {
    progress.textContent = error.message;
  }
  for (const button of buttons) button.disabled = false;
}

function secondSaid({ agrees }) {
  return agrees ? "Saved: the two marks agree." : "Saved: the two marks differ, and wait for a third decision.";
}
