// Requests to the API under the session cookie; every failure is an Error whose message is a sentence for the reader.

import { el } from "./dom.js";

const ROOT = "/api/v1";
const POLL_MS = 700;
const SILENCE_MS = 4000;

export class Problem extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

// On loopback a session begins with the first request; elsewhere the page already has one.
let session = document.body.dataset.learner ? Promise.resolve() : null;

function begin() {
  session ??= beginSession().catch((error) => { session = null; throw error; });
  return session;
}

async function beginSession() {
  let response;
  try {
    response = await fetch("/session", { method: "POST", credentials: "same-origin", headers: { Accept: "application/json" } });
  } catch {
    throw unreachable();
  }
  if (!response.ok) throw await problemOf(response);
  const { id, user } = await response.json();
  document.body.dataset.learner = id;
  document.querySelector(".who")?.replaceWith(el("p", { class: "who" }, el("span", {}, user), " ", el("a", { href: "/signout" }, "Sign out")));
}

const unreachable = () => new Problem("The server cannot be reached. Check the connection and try again.", 0);

export async function request(method, path, body, headers) {
  return (await tagged(method, path, body, headers)).body;
}

// The body and the ETag of a response.
export async function tagged(method, path, body, headers = {}) {
  await begin();
  let response;
  try {
    response = await fetch(ROOT + path, {
      method,
      credentials: "same-origin",
      headers: { Accept: "application/json", ...(body === undefined ? {} : { "Content-Type": "application/json" }), ...headers },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
  } catch {
    throw unreachable();
  }
  if (!response.ok) throw await problemOf(response);
  return { body: response.status === 204 ? null : await response.json(), etag: response.headers.get("ETag") };
}

async function problemOf(response) {
  const wait = Number(response.headers.get("Retry-After"));
  let sentence = `The server refused this (${response.status}).`;
  try {
    const problem = await response.json();
    sentence = problem.detail || problem.title || sentence;
  } catch {
    // not JSON: keep the sentence above
  }
  if (response.status === 401) sentence = "You are not signed in any more. Reload this page.";
  if (response.status === 429 && wait > 0) sentence += ` Try again in ${wait} s.`;
  return new Problem(sentence, response.status);
}

export const get = (path) => request("GET", path);
export const post = (path, body, headers) => request("POST", path, body, headers);

export function submit(quiz, question, answer) {
  // One key for one press of the button: a repeat after a lost connection makes no second submission.
  const key = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
  return post("/submissions", { quiz, question, answer }, { "Idempotency-Key": key });
}

export function atRest(submission) {
  return Boolean(submission.verdict) && !["queued", "running"].includes(submission.status);
}

// Waits for the verdict: by server-sent events, or by polling if the stream fails.
export async function awaitVerdict(submission, onStatus) {
  const path = `/submissions/${encodeURIComponent(submission.id)}`;
  await lastEvent(path, onStatus);
  for (;;) {
    const now = await get(path);
    if (atRest(now)) return now;
    onStatus(now.status);
    await pause(POLL_MS);
  }
}

// Settles with the last event, or as soon as the stream fails or stays silent.
function lastEvent(path, onStatus) {
  return new Promise((resolve) => {
    const source = new EventSource(`${ROOT}${path}/events`);
    const end = () => { clearTimeout(silence); source.close(); resolve(); };
    const silence = setTimeout(end, SILENCE_MS);
    for (const name of ["queued", "running"]) {
      source.addEventListener(name, () => { clearTimeout(silence); onStatus(name); });
    }
    for (const name of ["graded", "needs_review", "error"]) source.addEventListener(name, end);
  });
}

export function pause(milliseconds) {
  return new Promise((resolve) => setTimeout(resolve, milliseconds));
}

// The learner's newest submission of each question, by question; unreadable answers are left out.
export async function latestOf(quiz, learner, questions) {
  const latest = new Map();
  let cursor = null;
  do {
    const query = new URLSearchParams({ quiz, limit: 100, learner, ...(cursor ? { cursor } : {}) });
    const page = await get(`/submissions?${query}`);
    const readable = page.items.filter((one) => one.verdict?.status !== "invalid_answer");
    for (const one of readable) if (!latest.has(one.question)) latest.set(one.question, one);
    cursor = page.next_cursor;
  } while (cursor && latest.size < questions);
  return latest;
}

// Authors' HTML with TeX, made safe by the server: the only text that is ever set as HTML.
export async function setProse(node, prose) {
  const response = await fetch("/prose", { method: "POST", headers: { "Content-Type": "text/plain" }, body: prose });
  if (response.ok) node.innerHTML = await response.text();
  else node.textContent = prose.replace(/<[^>]*>/g, "");
}
