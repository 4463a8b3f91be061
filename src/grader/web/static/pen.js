// Draws lines, outlines, dots and arrows between points of the world on a canvas.

import { hull } from "./geometry.js";

const FOV = Math.PI / 4; // MuJoCo's default vertical field of view
const NEAR = 0.01;
const HEAD = 7;

export class Pen {
  constructor(canvas, view) {
    const ratio = (this.ratio = window.devicePixelRatio || 1);
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const zoom = Math.min(height, 1.2 * width) / 2 / Math.tan(FOV / 2); // a narrow picture keeps what a square one shows
    this.pixel = ([x, y, z]) => [width / 2 + (zoom * x) / z, height / 2 - (zoom * y) / z];
    this.isBefore = (seen) => seen[2] >= NEAR;
    this.see = view.see;
    this.soft = getComputedStyle(canvas).color;
    this.on = canvas.getContext("2d");
    this.on.clearRect(0, 0, width, height);
    this.on.lineJoin = "round";
  }

  outline(pixels, fill, stroke, dashes = []) {
    if (!pixels.length) return;
    this.on.beginPath();
    pixels.forEach(([x, y], index) => (index ? this.on.lineTo(x, y) : this.on.moveTo(x, y)));
    this.on.closePath();
    this.fill(fill);
    if (!stroke) return;
    this.on.setLineDash(dashes.map((length) => length * this.ratio));
    this.stroke(stroke, dashes.length ? 1.5 : 1);
    this.on.setLineDash([]);
  }

  // The convex patch over these points of the world.
  patch(points, fill) {
    const seen = points.map(this.see);
    if (seen.every(this.isBefore)) this.outline(hull(seen.map(this.pixel)), fill);
  }

  line(from, to, stroke, width = 2) {
    let [a, b] = [this.see(from), this.see(to)];
    if (!this.isBefore(a) && !this.isBefore(b)) return;
    if (!this.isBefore(a)) a = cut(b, a);
    if (!this.isBefore(b)) b = cut(a, b);
    this.on.beginPath();
    this.on.moveTo(...this.pixel(a));
    this.on.lineTo(...this.pixel(b));
    this.stroke(stroke, width);
  }

  dot(point, fill) {
    const seen = this.see(point);
    if (!this.isBefore(seen)) return;
    this.on.beginPath();
    this.on.arc(...this.pixel(seen), 3 * this.ratio, 0, 2 * Math.PI);
    this.fill(fill);
  }

  arrow(from, to, stroke) {
    this.line(from, to, stroke);
    const [a, b] = [this.see(from), this.see(to)];
    if (!this.isBefore(a) || !this.isBefore(b)) return;
    const [[x0, y0], [x, y]] = [this.pixel(a), this.pixel(b)];
    const length = Math.hypot(x - x0, y - y0), head = Math.min(HEAD * this.ratio, length / 2);
    if (head < 1) return;
    const [dx, dy] = [(head * (x - x0)) / length, (head * (y - y0)) / length];
    this.outline([[x, y], [x - dx - dy / 2, y - dy + dx / 2], [x - dx + dy / 2, y - dy - dx / 2]], stroke);
  }

  stroke(colour, width) {
    this.on.strokeStyle = colour;
    this.on.lineWidth = width * this.ratio;
    this.on.stroke();
  }

  fill(colour) {
    if (!colour) return;
    this.on.fillStyle = colour;
    this.on.fill();
  }
}

function cut(front, behind) {
  const part = (front[2] - NEAR) / (front[2] - behind[2]);
  return front.map((value, axis) => value + part * (behind[axis] - value));
}
