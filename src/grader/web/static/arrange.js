// Questions whose parts are dragged: items into an order, partners to texts. The lists (select) of the form stay what is
// sent: this moves items about and sets the lists. Without it the lists are the controls, as they stay for partners.

import { el } from "./dom.js";

const MARGIN_PX = 4; // a pointer that moved less has not dragged
const EDGE_PX = 64; // so near the end of the screen the page goes on

document.head.append(el("link", { rel: "stylesheet", href: new URL("arrange.css", import.meta.url).href }));

export function arrange(field) {
  const begin = { order, match }[field.dataset.arrange];
  begin?.(field);
  field.classList.add("is-live");
}

function order(field) {
  const list = field.querySelector(".arranged");
  const items = () => Array.from(list.children);
  const selects = () => items().map((item) => item.querySelector("select"));
  const aloud = field.querySelector("[data-said-aloud]");

  // Sets the positions as the items stand.
  const number = () => selects().forEach((select, index) => { select.value = String(index + 1); });

  // Moves an item by one place. Its neighbour is what moves: the item keeps the focus and the pointer.
  const step = (item, by) => {
    if (by < 0 && item.previousElementSibling) item.after(item.previousElementSibling);
    if (by > 0 && item.nextElementSibling) item.before(item.nextElementSibling);
  };

  const moved = (item) => {
    number();
    aloud.textContent = `${item.dataset.name}: position ${items().indexOf(item) + 1} of ${items().length}`;
    enable();
    list.dispatchEvent(new Event("input", { bubbles: true }));
  };

  const enable = () => items().forEach((item, index) => {
    for (const button of item.querySelectorAll("[data-step]")) {
      const isEnd = index === (button.dataset.step < 0 ? 0 : items().length - 1);
      button.setAttribute("aria-disabled", String(isEnd)); // not disabled, which would take the focus away
    }
  });

  // Puts the items where the lists say: a draft, or another tab, has changed them.
  const sort = () => {
    const places = new Map(items().map((item) => [item, Number(item.querySelector("select").value)]));
    if ([...places.values()].every(Boolean)) list.append(...items().sort((a, b) => places.get(a) - places.get(b)));
    number();
    enable();
  };

  for (const item of items()) {
    const select = item.querySelector("select");
    select.hidden = true;
    select.addEventListener("change", () => queueMicrotask(sort)); // after all of them have their values
    for (const button of item.querySelectorAll("[data-step]")) {
      button.hidden = false;
      button.addEventListener("click", () => {
        if (button.getAttribute("aria-disabled") === "true") return;
        step(item, Number(button.dataset.step));
        moved(item);
      });
    }
    drag(item, {
      begin: () => item.classList.add("is-dragged"),
      move: ({ clientY }) => {
        const [before, after] = [item.previousElementSibling, item.nextElementSibling];
        if (before && clientY < middle(before)) step(item, -1);
        else if (after && clientY > middle(after)) step(item, 1);
      },
      end: () => { item.classList.remove("is-dragged"); moved(item); },
    });
  }
  sort();
}

function match(field) {
  for (const right of field.querySelectorAll("[data-right]")) {
    let from = null;
    let target = null;
    const mark = (row) => { target?.classList.remove("is-target"); target = row; row?.classList.add("is-target"); };
    drag(right, {
      begin: ({ clientX, clientY }) => { from = [clientX, clientY + scrollY]; right.classList.add("is-dragged"); },
      move: ({ clientX, clientY }) => {
        right.style.transform = `translate(${clientX - from[0]}px, ${clientY + scrollY - from[1]}px)`;
        const row = document.elementFromPoint(clientX, clientY)?.closest(".pair"); // what is dragged lets it through
        mark(row && field.contains(row) ? row : null);
      },
      end: () => {
        right.style.transform = "";
        right.classList.remove("is-dragged");
        const select = target?.querySelector("select");
        mark(null);
        if (!select) return;
        select.value = right.dataset.right;
        select.dispatchEvent(new Event("input", { bubbles: true }));
      },
    });
  }
}

const middle = (node) => { const { top, height } = node.getBoundingClientRect(); return top + height / 2; };

// Follows a pointer from where it is pressed; `begin` is called once it has moved, `end` after that alone. A finger drags
// by the grip, and scrolls the page elsewhere.
function drag(node, { begin, move, end }) {
  node.addEventListener("pointerdown", (down) => {
    const { target, button, pointerType, pointerId } = down;
    if (button !== 0 || target.closest("button, select, a") || (pointerType === "touch" && !target.closest("[data-grip]"))) return;
    down.preventDefault();
    node.setPointerCapture(pointerId);
    let isDragged = false;
    let last = down;
    const going = setInterval(() => {
      const by = last.clientY < EDGE_PX ? -9 : last.clientY > innerHeight - EDGE_PX ? 9 : 0;
      if (!isDragged || !by) return;
      scrollBy({ top: by, behavior: "instant" });
      move(last);
    }, 16);
    const follow = (event) => {
      if (!isDragged && Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) < MARGIN_PX) return;
      if (!isDragged) begin(down);
      isDragged = true;
      move(last = event);
    };
    const leave = () => {
      clearInterval(going);
      node.removeEventListener("pointermove", follow);
      for (const name of ["pointerup", "pointercancel"]) node.removeEventListener(name, leave);
      if (isDragged) end();
    };
    node.addEventListener("pointermove", follow);
    for (const name of ["pointerup", "pointercancel"]) node.addEventListener(name, leave);
  });
}
