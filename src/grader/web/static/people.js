// The page of a course's people: invitations, the course link, members, tokens and the audit log.

import { get, post, request } from "./api.js";
import { el } from "./dom.js";

const find = (name) => document.querySelector(`[data-${name}]`);
const status = find("status");
const cursors = {};
let queue = Promise.resolve();
const when = (time) => (time ? el("time", { datetime: time }, new Date(time).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" })) : "never");

const WAYS = { name: "named here", oidc: "signs in", browser: "course link", lti: "a platform" };

// Where a member comes from, and whether somebody else here has the same address.
function origin(one) {
  const there = one.platforms.map(({ platform, course }) => `${platform}: ${course}`);
  const known = one.way_in === "lms" ? `${one.learner.namespace}: ${one.learner.id}` : WAYS[one.way_in];
  const twin = one.same_email.length ? [el("br"), el("strong", {}, `Another member has ${one.email} too: perhaps the same person`)] : [];
  return [there.join(", ") || known, ...twin];
}

const CELLS = {
  invitations: (one) => [one.name, one.role, when(one.created_at), when(one.expires_at), ending("invitations", one, "Revoke")],
  members: (one) => [one.name, one.role, origin(one), when(one.created_at), [
    action("New link", () => invite({ member: one.id })),
    one.role === "student" ? action("Make instructor", () => change("PATCH", `/members/${one.id}`, { role: "instructor" })) : null,
    action("Remove", () => confirm(`Remove ${one.name} from the course?`) && change("DELETE", `/members/${one.id}`))]],
  tokens: (one) => [one.name, one.role, one.scopes ? one.scopes.join(" ") : "all", when(one.expires_at), when(one.last_used_at), ending("tokens", one, "Revoke")],
  audit: (one) => [when(one.at), one.name, one.action, one.subject, ""],
};

for (const name of Object.keys(CELLS)) document.querySelector(`[data-more=${name}]`).addEventListener("click", () => told(() => list(name, false)));
find("invite").addEventListener("submit", (event) => {
  event.preventDefault();
  const { names, role } = Object.fromEntries(new FormData(event.target));
  invite({ names: names.split("\n").map((one) => one.trim()).filter(Boolean), role });
});
find("token").addEventListener("submit", (event) => { event.preventDefault(); createToken(new FormData(event.target)); });
find("rotate").addEventListener("click", () => change("PUT", "/course/link"));
find("close").addEventListener("click", () => change("DELETE", "/course/link"));
for (const button of document.querySelectorAll("button[disabled]")) button.disabled = false; // a click before this would be lost
told(show);

// One request after the other: a late response must not overwrite a newer one.
function told(work) {
  queue = queue.then(async () => {
    status.textContent = "";
    try {
      await work();
    } catch (error) {
      status.textContent = error.message;
      status.scrollIntoView({ block: "nearest" });
    }
  });
}

async function show() {
  const { join_url: url } = await get("/course");
  find("course-link").replaceChildren(url ? secret("Course link", url) : "There is no link now.");
  find("close").hidden = !url;
  await Promise.all(Object.keys(CELLS).map((name) => list(name, true)));
}

async function list(name, afresh) {
  const query = afresh || !cursors[name] ? "" : `?cursor=${encodeURIComponent(cursors[name])}`;
  const page = await get(`/${name}${query}`);
  const rows = document.querySelector(`[data-list=${name}]`);
  if (afresh) rows.replaceChildren();
  rows.append(...page.items.map((one) => el("tr", {}, CELLS[name](one).map((cell) => el("td", {}, cell)))));
  if (!rows.children.length) rows.append(el("tr", {}, el("td", { colspan: 6 }, "None.")));
  cursors[name] = page.next_cursor;
  document.querySelector(`[data-more=${name}]`).hidden = !page.next_cursor;
}

const action = (label, onclick) => el("button", { type: "button", class: "link", onclick }, label);
const ending = (name, one, label) => action(label, () => change("DELETE", `/${name}/${one.id}`));

const change = (method, path, body) => told(async () => {
  await request(method, path, body);
  await show();
});

const invite = (body) => told(async () => {
  const made = await post("/invitations", body);
  find("links").replaceChildren(
    el("p", { class: "notice" }, "These links are shown this once; each works once."),
    ...made.items.map((one) => secret(one.name, one.url)));
  find("invite").reset();
  await show();
});

const createToken = (form) => told(async () => {
  const scopes = form.getAll("scopes");
  const days = form.get("days");
  const made = await post("/tokens", {
    user: form.get("user"), role: form.get("role"), ...(scopes.length ? { scopes } : {}), ...(days ? { days: Number(days) } : {}),
  });
  find("secret").replaceChildren(el("p", { class: "notice" }, "The token is shown this once."), secret(form.get("user"), made.token));
  find("token").reset();
  await show();
});

// A field to copy from.
function secret(label, value) {
  return el("label", { class: "field" }, label, " ", el("input", { type: "text", readonly: true, value, onfocus: (event) => event.target.select() }));
}
