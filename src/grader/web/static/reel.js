// A reel of attempts: the slider and the links fetch the page of another attempt and take over its parts, so that there is
// one rendering. Without this the links lead to the pages.

import { watchFilms } from "./near.js";
import { Newest } from "./newest.js";
import { localise } from "./times.js";

const bar = document.querySelector(".reel-bar");
const slider = bar.querySelector("[data-slider]");
const stops = [...bar.querySelectorAll("[data-stops] > li")];
const pages = new Map(); // by address
const wishes = new Newest(fetchPage, show, (_, address) => location.assign(address));

const addressOf = (place) => `${location.pathname}?attempt=${encodeURIComponent(stops[place].dataset.id)}`;

slider.disabled = false;
slider.addEventListener("input", () => {
  slider.setAttribute("aria-valuetext", stops[slider.value].textContent);
  wishes.want(addressOf(slider.value));
});
bar.addEventListener("click", (event) => {
  const link = event.target.closest("[data-step]");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
  event.preventDefault();
  wishes.want(link.getAttribute("href"));
});
watchFilms(document);

async function fetchPage(address) {
  if (!pages.has(address)) {
    const response = await fetch(address, { headers: { Accept: "text/html" }, credentials: "same-origin" });
    if (!response.ok) throw new Error(response.statusText);
    pages.set(address, await response.text());
  }
  return pages.get(address);
}

function show(text, address) {
  const page = new DOMParser().parseFromString(text, "text/html");
  localise(page);
  const fresh = page.querySelector(".reel-bar"), held = document.activeElement;
  const way = held?.closest?.(".reel-bar [rel]")?.rel;
  for (const at of [0, 2]) bar.children[at].replaceWith(document.importNode(fresh.children[at], true));
  bar.querySelector("[role=status]").replaceChildren(...document.importNode(fresh.querySelector("[role=status]"), true).childNodes);
  const stop = fresh.querySelector("[data-slider]");
  if (document.activeElement !== slider || !wishes.wish) slider.value = stop.getAttribute("value");
  slider.setAttribute("aria-valuetext", stop.getAttribute("aria-valuetext"));
  if (way) (bar.querySelector(`[rel=${way}]`) ?? slider).focus();
  const frame = document.importNode(page.getElementById("reel-frame"), true);
  document.getElementById("reel-frame").replaceWith(frame);
  watchFilms(frame);
  history.replaceState(null, "", address);
}
