// A review by keyboard: 1 to 9 tick the rubric, Enter decides. The form itself works without this.

import { post } from "./api.js";
import { number } from "./dom.js";
import { watchFilms } from "./near.js";
import { localise } from "./times.js";

const HEARTBEAT_MS = 5 * 60_000;

const form = document.querySelector("[data-review]");
const boxes = [...form.querySelectorAll("[type=checkbox]")];
const claim = form.querySelector("[data-claim]");

document.addEventListener("keydown", onKey);
form.querySelector("[data-insert]")?.addEventListener("click", insert);
for (const box of boxes) box.addEventListener("change", sum);
if ("held" in form.dataset) setInterval(heartbeat, HEARTBEAT_MS);
sum();
watchFilms(document);

// The sum of the ticked items stands in the empty field of the points, which win where they are typed.
function sum() {
  if (!boxes.length) return;
  const points = boxes.reduce((total, box) => total + (box.checked ? Number(box.dataset.points) : 0), 0);
  form.points.placeholder = number(Math.min(Math.max(points, 0), Number(form.points.max)));
}

function insert(event) {
  event.preventDefault();
  const text = form.saved.selectedOptions[0]?.textContent ?? "";
  form.comment.value = [form.comment.value.trim(), text].filter(Boolean).join("\n");
  form.comment.focus();
}

async function heartbeat() {
  try {
    const { expires_at: until } = await post("/reviews:heartbeat", { submission_id: form.dataset.review });
    claim.querySelector("time").dateTime = until;
    localise(claim);
  } catch (error) {
    claim.textContent = error.message;
  }
}

function onKey(event) {
  if (event.altKey || event.metaKey || event.repeat) return;
  const inText = event.target.matches("input:not([type=checkbox]), textarea, select");
  if (event.key === "Enter" && (event.ctrlKey || !event.target.closest("a, button, summary, input, textarea, select"))) {
    event.preventDefault();
    form.querySelector("[data-next]")?.click();
  } else if (!inText && !event.ctrlKey && /^[1-9]$/.test(event.key)) {
    boxes[Number(event.key) - 1]?.click();
  }
}
