// The drawn geoms of a recorded run on a canvas: every primitive as the outline of its projected points.

const FOV = Math.PI / 4; // MuJoCo's default vertical field of view
const NEAR = 0.01;
const ROUND = 20;
const BALL = ballPoints();
const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const AXIS_COLOURS = ["#c92a2a", "#2b8a3e", "#1864ab"];

export class Scene {
  // geoms: [{type, size: [3], rgba: [4]}]; camera: {azimuth, elevation, distance, target} in degrees and metres,
  // where it leaves something out, so that the poses at the start fit.
  // `turned` is what the learner adds: degrees to azimuth and elevation, a factor to distance.
  constructor(canvas, geoms, camera, poses, turned) {
    this.canvas = canvas;
    this.geoms = geoms.map((geom) => ({ ...geom, points: surface(geom.type, geom.size) }));
    this.camera = { azimuth: 90, elevation: -20, ...fitting(geoms, poses), ...camera };
    this.turned = turned;
  }

  get reach() {
    return this.camera.distance;
  }

  turnedView() {
    const { azimuth, elevation, distance, target } = this.camera;
    const up = Math.min(89, Math.max(-89, elevation + this.turned.elevation));
    return viewFrom({ azimuth: azimuth + this.turned.azimuth, elevation: up, distance: distance * this.turned.distance, target });
  }

  // poses: one [x, y, z, qw, qx, qy, qz] per geom; trail: [[x, y, z], ...]; over: by overlay, the rows of this frame;
  // shown: the names of the overlays to draw; forceScale: the length of a force's arrow [m/N].
  draw(poses, trail = [], over = {}, shown = new Set(), forceScale = 0) {
    this.view = this.turnedView();
    const pixel = this.fit();
    const pen = this.canvas.getContext("2d");
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    const solid = [];
    this.geoms.forEach((geom, index) => {
      if (poses[index].includes(null)) return; // the state is not finite
      if (geom.type === "plane") this.drawGrid(pen, pixel, geom, poses[index]);
      else solid.push({ geom, pose: poses[index], depth: this.view.see(poses[index])[2] });
    });
    this.drawTrail(pen, pixel, trail);
    solid.sort((a, b) => b.depth - a.depth);
    for (const { geom, pose } of solid) this.drawSolid(pen, pixel, geom, pose);
    this.drawOver(pen, pixel, over, shown, forceScale);
  }

  // Overlays lie on top of the bodies, so that what is inside or behind them is seen.
  drawOver(pen, pixel, over, shown, forceScale) {
    const size = 0.06 * this.reach;
    const rows = (name) => (shown.has(name) ? over[name] ?? [] : []).filter((row) => !row.includes(null));
    for (const pose of rows("frames")) {
      AXES.forEach((axis, i) => this.arrow(pen, pixel, pose, placed(pose, axis.map((value) => size * value)), AXIS_COLOURS[i]));
    }
    for (const [x, y, z, ...axis] of rows("joints")) {
      this.arrow(pen, pixel, [x, y, z], [x, y, z].map((value, i) => value + 1.5 * size * axis[i]), "#0b7285");
    }
    for (const point of rows("com")) this.dot(pen, pixel, point, "#862e9c");
    for (const point of rows("sites")) this.dot(pen, pixel, point, "#2b8a3e");
    for (const [x, y, z] of rows("contacts")) this.dot(pen, pixel, [x, y, z], "#e8590c");
    const acting = shown.has("forces") ? over.contacts ?? [] : [];
    for (const row of acting.filter((one) => !one.includes(null))) {
      const point = row.slice(0, 3);
      this.arrow(pen, pixel, point, point.map((value, i) => value + forceScale * row[3 + i]), "#c2255c");
    }
  }

  dot(pen, pixel, point, fill) {
    const seen = this.view.see(point);
    if (seen[2] < NEAR) return;
    pen.beginPath();
    pen.arc(...pixel(seen), 3 * (window.devicePixelRatio || 1), 0, 2 * Math.PI);
    pen.fillStyle = fill;
    pen.fill();
  }

  arrow(pen, pixel, from, to, stroke) {
    const ratio = window.devicePixelRatio || 1;
    pen.strokeStyle = stroke;
    pen.lineWidth = 2 * ratio;
    this.segment(pen, pixel, from, to);
    const [a, b] = [this.view.see(from), this.view.see(to)];
    if (a[2] < NEAR || b[2] < NEAR) return;
    const [[x0, y0], [x, y]] = [pixel(a), pixel(b)];
    const length = Math.hypot(x - x0, y - y0), head = Math.min(7 * ratio, length / 2);
    if (head < 1) return;
    const [dx, dy] = [(head * (x - x0)) / length, (head * (y - y0)) / length];
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x - dx - dy / 2, y - dy + dx / 2);
    pen.lineTo(x - dx + dy / 2, y - dy - dx / 2);
    pen.closePath();
    pen.fillStyle = stroke;
    pen.fill();
  }

  fit() {
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(this.canvas.clientWidth * ratio), height = Math.round(this.canvas.clientHeight * ratio);
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
    const zoom = height / 2 / Math.tan(FOV / 2);
    return ([x, y, z]) => [width / 2 + (zoom * x) / z, height / 2 - (zoom * y) / z];
  }

  drawSolid(pen, pixel, geom, pose) {
    const seen = geom.points.map((point) => this.view.see(placed(pose, point)));
    if (seen.some(([, , depth]) => depth < NEAR)) return;
    const outline = hull(seen.map(pixel));
    pen.beginPath();
    outline.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
    pen.fillStyle = colour(geom.rgba, 1);
    pen.fill();
    pen.strokeStyle = colour(geom.rgba, 0.65);
    pen.lineWidth = window.devicePixelRatio || 1;
    pen.stroke();
  }

  drawGrid(pen, pixel, geom, pose) {
    const reach = [geom.size[0] || 2, geom.size[1] || 2].map((half) => Math.min(half, 2));
    pen.strokeStyle = "rgba(128, 128, 128, 0.35)";
    pen.lineWidth = 1;
    for (let i = -4; i <= 4; i++) {
      const x = (i / 4) * reach[0], y = (i / 4) * reach[1];
      this.segment(pen, pixel, placed(pose, [x, -reach[1], 0]), placed(pose, [x, reach[1], 0]));
      this.segment(pen, pixel, placed(pose, [-reach[0], y, 0]), placed(pose, [reach[0], y, 0]));
    }
  }

  drawTrail(pen, pixel, trail) {
    pen.strokeStyle = "rgba(194, 112, 61, 0.7)";
    pen.lineWidth = 1.5 * (window.devicePixelRatio || 1);
    for (let i = 1; i < trail.length; i++) this.segment(pen, pixel, trail[i - 1], trail[i]);
  }

  segment(pen, pixel, from, to) {
    let [a, b] = [this.view.see(from), this.view.see(to)];
    if (a[2] < NEAR && b[2] < NEAR) return;
    if (a[2] < NEAR) a = cut(b, a);
    if (b[2] < NEAR) b = cut(a, b);
    pen.beginPath();
    pen.moveTo(...pixel(a));
    pen.lineTo(...pixel(b));
    pen.stroke();
  }
}

function cut(front, behind) {
  const part = (front[2] - NEAR) / (front[2] - behind[2]);
  return front.map((value, axis) => value + part * (behind[axis] - value));
}

function fitting(geoms, poses) {
  const centres = poses.filter((pose, index) => geoms[index].type !== "plane" && !pose.includes(null)).map((pose) => pose.slice(0, 3));
  if (!centres.length) return { distance: 2, target: [0, 0, 0] };
  const ends = [0, 1, 2].map((axis) => {
    const along = centres.map((centre) => centre[axis]);
    return [Math.min(...along), Math.max(...along)];
  });
  const extent = Math.max(0.3, ...ends.map(([low, high]) => high - low), ...geoms.filter((geom) => geom.type !== "plane").flatMap((geom) => geom.size));
  return { distance: 3 * extent, target: ends.map(([low, high]) => (low + high) / 2) };
}

// MuJoCo's free camera: it looks from `distance` away at `target`, along azimuth and elevation.
function viewFrom({ azimuth, elevation, distance, target }) {
  const [az, up] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
  const forward = [Math.cos(up) * Math.cos(az), Math.cos(up) * Math.sin(az), Math.sin(up)];
  const right = [Math.sin(az), -Math.cos(az), 0];
  const above = cross(right, forward);
  const eye = target.map((value, axis) => value - distance * forward[axis]);
  return {
    see: (point) => {
      const from = [point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]];
      return [dot(right, from), dot(above, from), dot(forward, from)];
    },
  };
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// A point of the geom's own frame in the world: v + 2 w (u x v) + 2 u x (u x v) for the quaternion (w, u).
function placed([x, y, z, w, ...u], point) {
  const once = cross(u, point), twice = cross(u, once);
  return [x, y, z].map((origin, axis) => origin + point[axis] + 2 * (w * once[axis] + twice[axis]));
}

// Sizes as in MuJoCo: half lengths; the long axis of capsule and cylinder is z.
function surface(type, [a = 0, b = 0, c = 0]) {
  if (type === "sphere") return BALL.map((p) => p.map((value) => a * value));
  if (type === "ellipsoid") return BALL.map((p) => [a * p[0], b * p[1], c * p[2]]);
  if (type === "capsule") return BALL.map((p) => [a * p[0], a * p[1], a * p[2] + Math.sign(p[2]) * b]);
  if (type === "cylinder") return [-b, b].flatMap((z) => circle(a, z));
  if (type === "box") return [-a, a].flatMap((x) => [-b, b].flatMap((y) => [-c, c].map((z) => [x, y, z])));
  return [];
}

function circle(radius, z) {
  return Array.from({ length: ROUND }, (_, i) => [radius * Math.cos((2 * Math.PI * i) / ROUND), radius * Math.sin((2 * Math.PI * i) / ROUND), z]);
}

function ballPoints() {
  const rings = [];
  for (let i = 0; i <= 12; i++) {
    const height = Math.cos((Math.PI * (i + 0.01)) / 12.02);
    rings.push(...circle(Math.sqrt(1 - height * height), height));
  }
  return rings;
}

// Andrew's monotone chain.
function hull(points) {
  const sorted = points.slice().sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1 && turn(chain[chain.length - 2], chain[chain.length - 1], p) <= 0) chain.pop();
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

const turn = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);

function colour([r = 0.5, g = 0.5, b = 0.5, alpha = 1], shade) {
  const channel = (value) => Math.round(255 * shade * value);
  return `rgba(${channel(r)}, ${channel(g)}, ${channel(b)}, ${alpha})`;
}
