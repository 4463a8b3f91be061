// Requests to the API under the session cookie; every failure is an Error whose message is a sentence for the reader.

import { el } from "./dom.js";
import { alone } from "./drafts.js";

const ROOT = "/api/v1";

export class Problem extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

// On loopback a session begins with the first request; elsewhere the page already has one.
let session = document.body.dataset.learner ? Promise.resolve() : null;

function begin() {
  session ??= alone(beginSession).catch((error) => { session = null; throw error; });
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
