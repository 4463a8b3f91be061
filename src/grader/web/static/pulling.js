// Pulls a body of a scene: by the pointer, from where it is grabbed to where it is let go; or by a form, for the keyboard.

import { el } from "./dom.js";
import { plus } from "./geometry.js";

const LEAST = 6; // a shorter way is a click [px]
const REACH = 0.25; // of a pull by the form, in distances of the camera
const WAYS = { left: ["right", -1], right: ["right", 1], up: ["above", 1], down: ["above", -1], away: ["forward", 1], nearer: ["forward", -1] };

export class Pulling {
  // lab: {scene, draw(), pause(), pull(geom, point, goal)}. Listens before whatever turns the camera.
  constructor(canvas, form, lab) {
    Object.assign(this, { canvas, lab, held: null });
    canvas.addEventListener("pointerdown", (event) => this.grab(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.release(event));
    canvas.addEventListener("pointercancel", () => this.drop());
    canvas.addEventListener("keydown", (event) => { if (event.key === "Escape") this.drop(); });
    canvas.addEventListener("touchstart", (event) => { // else the page scrolls
      if (event.touches.length === 1 && this.find(event.touches[0])) event.preventDefault();
    }, { passive: false });
    this.listenToForm(form);
  }

  // The arrow to draw; null while nothing is pulled.
  get arrow() {
    return this.held && { from: this.lab.scene.placeOf(this.held), to: this.held.goal };
  }

  find({ clientX, clientY }) {
    return this.lab.scene?.pick(clientX, clientY) ?? null;
  }

  grab(event) {
    const found = event.button === 0 && !event.shiftKey ? this.find(event) : null;
    if (!found) return;
    event.stopImmediatePropagation(); // the camera stays
    this.canvas.setPointerCapture(event.pointerId);
    this.lab.pause();
    this.held = { ...found, goal: this.lab.scene.placeOf(found), at: [event.clientX, event.clientY] };
    this.canvas.style.cursor = "grabbing";
    this.lab.draw();
  }

  move(event) {
    if (!this.held) {
      if (!event.buttons && event.pointerType === "mouse") this.canvas.style.cursor = this.find(event) ? "grab" : "move";
      return;
    }
    event.stopImmediatePropagation();
    this.held.goal = this.lab.scene.pointBeside(this.lab.scene.placeOf(this.held), event.clientX, event.clientY);
    this.lab.draw();
  }

  release(event) {
    const { held } = this;
    this.drop();
    if (held && Math.hypot(event.clientX - held.at[0], event.clientY - held.at[1]) >= LEAST) this.lab.pull(held.index, held.point, held.goal);
  }

  drop() {
    if (!this.held) return;
    this.held = null;
    this.canvas.style.cursor = "";
    this.lab.draw();
  }

  listenToForm({ body, way, button }) {
    this.body = body;
    this.fields = [body, way, button];
    button.addEventListener("click", () => {
      const index = Number(body.value), { scene } = this.lab, [axis, sign] = WAYS[way.value];
      const goal = plus(scene.placeOf({ index, point: [0, 0, 0] }), scene.view[axis], sign * REACH * scene.camera.distance);
      this.lab.pull(index, [0, 0, 0], goal);
    });
  }

  // The bodies of another run, each by the last of its geoms.
  name(geoms) {
    const bodies = new Map(geoms.flatMap(({ body }, index) => (body ? [[body, index]] : [])));
    const chosen = this.body.selectedOptions[0]?.textContent;
    this.body.replaceChildren(...Array.from(bodies, ([name, index]) => el("option", { value: index, selected: name === chosen }, name)));
    for (const field of this.fields) field.disabled = !bodies.size;
  }
}
