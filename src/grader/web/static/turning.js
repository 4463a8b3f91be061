// Turns the camera of a scene: by dragging, by the arrow keys, and nearer or farther by plus and minus.

const DEGREES_PER_PIXEL = 0.5, DEGREES_PER_KEY = 10, NEARER = 1.15;
const KEYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Turning {
  // onTurn() after every change. What is added to the camera: degrees, and a factor to its distance.
  constructor(canvas, onTurn) {
    this.azimuth = this.elevation = 0;
    this.distance = 1;
    this.onTurn = onTurn;
    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      this.turn(-DEGREES_PER_PIXEL * (event.clientX - last[0]), -DEGREES_PER_PIXEL * (event.clientY - last[1]));
      last = [event.clientX, event.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { last = null; });
    canvas.addEventListener("keydown", (event) => this.pressed(event));
  }

  pressed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const turn = KEYS[event.key], factor = { "+": 1 / NEARER, "=": 1 / NEARER, "-": NEARER }[event.key];
    if (!turn && !factor) return;
    event.preventDefault();
    if (factor) this.distance = Math.min(10, Math.max(0.1, this.distance * factor));
    this.turn(...(turn ?? [0, 0]).map((way) => DEGREES_PER_KEY * way));
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.min(180, Math.max(-180, this.elevation + elevation));
    this.onTurn();
  }
}
