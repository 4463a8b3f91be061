// A review: opening the form claims the submission; If-Match guards against changes since then.

import { setProse, tagged } from "./api.js";

const form = document.querySelector("[data-review]");
const [reference, progress] = ["reference", "deciding"].map((name) => form.querySelector(`[data-${name}]`));
const button = form.querySelector("button");
let seen = null;

form.addEventListener("submit", (event) => { event.preventDefault(); decide(); });

export function closeReview() {
  form.hidden = true;
  seen = null;
}

// Claims only submissions that need a review; any other verdict may be reviewed too, without a claim.
export async function openReview(submission, onDecided) {
  const { verdict } = submission;
  const waits = submission.status === "needs_review";
  const path = `/submissions/${encodeURIComponent(submission.id)}`;
  const { body, etag } = await (waits ? tagged("POST", "/reviews:claim", { submission_id: submission.id }) : tagged("GET", path));
  seen = { path, etag, onDecided };
  form.reset();
  form.points.max = verdict.max_points;
  form.points.value = waits ? "" : verdict.points;
  progress.textContent = body.claim ? `Yours until ${new Date(body.claim.expires_at).toLocaleTimeString()}.` : "";
  reference.hidden = !body.reference;
  if (body.reference) setProse(reference, body.reference);
  form.hidden = false;
}

async function decide() {
  const { path, etag, onDecided } = seen;
  button.disabled = true;
  progress.textContent = "Saving…";
  try {
    const decision = { points: Number(form.points.value), comment: form.comment.value };
    const { body, etag: next } = await tagged("PUT", `${path}/review`, decision, { "If-Match": etag });
    seen.etag = next;
    progress.textContent = "Decided. The learner sees it now.";
    onDecided(body);
  } catch (error) {
    progress.textContent = error.message;
  }
  button.disabled = false;
}
