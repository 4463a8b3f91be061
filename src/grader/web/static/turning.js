// Turns the camera of a scene: by dragging, by the arrow keys; nearer or farther by plus and minus, by two fingers, and by the wheel
// over a scene in use, which is focused. Elsewhere the wheel scrolls the page.

const DEGREES_PER_PIXEL = 0.5, DEGREES_PER_KEY = 10, NEARER = 1.15, PER_WHEEL = 0.0015, LINE = 20;
const KEYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Turning {
  // onTurn() after every change. What is added to the camera: degrees, and a factor to its distance.
  constructor(canvas, onTurn) {
    this.azimuth = this.elevation = 0;
    this.distance = 1;
    this.onTurn = onTurn;
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("keydown", (event) => this.pressed(event));
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return; // a pinch of a touchpad sends Ctrl
      event.preventDefault();
      this.zoom(Math.exp(PER_WHEEL * event.deltaY * (event.deltaMode ? LINE : 1)));
    }, { passive: false });
  }

  get gap() {
    const [[x, y], [u, v]] = this.pointers.values();
    return Math.hypot(x - u, y - v);
  }

  moved({ pointerId, clientX, clientY }) {
    const last = this.pointers.get(pointerId), before = this.pointers.size === 2 ? this.gap : 0;
    if (!last) return;
    this.pointers.set(pointerId, [clientX, clientY]);
    if (before) this.zoom(before / Math.max(1, this.gap));
    else this.turn(-DEGREES_PER_PIXEL * (clientX - last[0]), -DEGREES_PER_PIXEL * (clientY - last[1]));
  }

  pressed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const turn = KEYS[event.key], factor = { "+": 1 / NEARER, "=": 1 / NEARER, "-": NEARER }[event.key];
    if (!turn && !factor) return;
    event.preventDefault();
    if (factor) this.zoom(factor);
    else this.turn(...turn.map((way) => DEGREES_PER_KEY * way));
  }

  zoom(factor) {
    this.distance = Math.min(10, Math.max(0.1, this.distance * factor));
    this.onTurn();
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.min(180, Math.max(-180, this.elevation + elevation));
    this.onTurn();
  }
}
