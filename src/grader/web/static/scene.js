// The drawn geoms of a recorded run on a canvas, the farthest first, with their shadows and the last run's outlines.

import { drawOverlays } from "./overlays.js";
import { Pen } from "./pen.js";
import { hull, placed, turned, viewFrom } from "./geometry.js";

const CIRCLE = Array.from({ length: 24 }, (_, i) => [Math.cos((2 * Math.PI * i) / 24), Math.sin((2 * Math.PI * i) / 24)]);
const BALL = [-0.9, -0.5, 0, 0.5, 0.9].flatMap((z) => CIRCLE.map(([x, y]) => [x * Math.sqrt(1 - z * z), y * Math.sqrt(1 - z * z), z]))
  .concat([[0, 0, -1], [0, 0, 1]]);
const FACES = [0, 1, 2].flatMap((axis) => [-1, 1].map((sign) => ({ axis, sign })));
const DISTANCE = 1.7; // of the camera, in sizes of what it shows
const FOLLOWED = 4; // how many times larger than the solids themselves a motion may be to be shown whole
const FLOOR = 2; // how much of an endless plane is drawn [m]

export class Scene {
  // geoms: [{type, size: [3], rgba: [4]}]; camera: {azimuth, elevation, distance, target} in degrees and metres,
  // where it leaves something out, so that `frames` fit: lists of poses, of which the first is the start.
  // `turning` is what the learner adds: degrees to azimuth and elevation, a factor to distance.
  constructor(canvas, geoms, camera, frames, turning) {
    this.canvas = canvas;
    this.geoms = geoms;
    this.camera = { azimuth: 90, elevation: -20, ...fitting(geoms, frames), ...camera };
    this.turning = turning;
  }

  // poses: one [x, y, z, qw, qx, qy, qz] per geom; `ghost` the same of the last run, `past` of frames before; `trail`: [[x, y, z], ...];
  // `over`: by overlay, the rows of this frame; `shown`: what is drawn over the scene; `forceScale` [m/N].
  draw({ poses, ghost, past = [], trail = [], over = {}, shown = new Set(), forceScale = 0 }) {
    const { azimuth, elevation, distance, target } = this.camera;
    const up = Math.min(89, Math.max(-89, elevation + this.turning.elevation));
    const view = viewFrom({ azimuth: azimuth + this.turning.azimuth, elevation: up, distance: distance * this.turning.distance, target });
    const pen = new Pen(this.canvas, view);
    const there = this.geoms.map((geom, index) => ({ geom, pose: poses[index] })).filter(({ pose }) => !pose.includes(null)); // finite
    const floors = there.filter(({ geom }) => geom.type === "plane"), solids = there.filter(({ geom }) => geom.type !== "plane");
    for (const { geom, pose } of floors) grid(pen, geom, pose);
    if (shown.has("shadows")) for (const floor of floors) for (const solid of solids) shadow(pen, floor, solid);
    for (let i = 1; i < trail.length; i++) pen.line(trail[i - 1], trail[i], "rgba(194, 112, 61, .75)", 1.5);
    const deep = solids.map((one) => ({ ...one, depth: view.see(one.pose)[2] })).sort((a, b) => b.depth - a.depth);
    for (const one of past) this.drawGhost(pen, view, one);
    for (const { geom, pose } of deep) solid(pen, view, geom, pose);
    if (ghost) this.drawGhost(pen, view, ghost);
    drawOverlays(pen, over, shown, forceScale, this.camera.distance);
  }

  drawGhost(pen, view, ghost) {
    this.geoms.forEach((geom, index) => {
      if (geom.type === "plane" || !ghost[index] || ghost[index].includes(null)) return;
      pen.outline(hullOf(pen, view, geom, ghost[index]), null, pen.soft, [3, 4]);
    });
  }
}

// What shows the solids in these frames: how far away, and where to look. A motion that leads far away is not followed.
function fitting(geoms, frames) {
  const first = ends(geoms, frames.slice(0, 1)), whole = ends(geoms, frames);
  if (!Number.isFinite(first.size)) return { distance: 2, target: [0, 0, 0] };
  const { size, target } = whole.size <= FOLLOWED * first.size ? whole : first;
  return { distance: DISTANCE * size, target };
}

// The largest side and the middle of the box around the solids in these frames.
function ends(geoms, frames) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const poses of frames) {
    poses.forEach((pose, index) => {
      if (geoms[index].type === "plane" || pose.includes(null)) return;
      const radius = reachOf(geoms[index]);
      for (const axis of [0, 1, 2]) {
        low[axis] = Math.min(low[axis], pose[axis] - radius);
        high[axis] = Math.max(high[axis], pose[axis] + radius);
      }
    });
  }
  return { size: Math.max(...high.map((value, axis) => value - low[axis])), target: high.map((value, axis) => (value + low[axis]) / 2) };
}

const reachOf = ({ type, size: [a, b, c] }) => (type === "capsule" ? a + b : type === "cylinder" ? Math.hypot(a, b) : type === "box" ? Math.hypot(a, b, c) : Math.max(a, b, c));

// Sizes as in MuJoCo: half lengths; the long axis of capsule and cylinder is z.
function surface({ type, size: [a = 0, b = 0, c = 0] }) {
  if (type === "ellipsoid") return BALL.map((p) => [a * p[0], b * p[1], c * p[2]]);
  if (type === "cylinder") return [-b, b].flatMap((z) => CIRCLE.map(([x, y]) => [a * x, a * y, z]));
  if (type === "sphere") return BALL.map((p) => p.map((value) => a * value));
  if (type === "capsule") return BALL.map((p) => [a * p[0], a * p[1], a * p[2] + Math.sign(p[2]) * b]);
  return [-a, a].flatMap((x) => [-b, b].flatMap((y) => [-c, c].map((z) => [x, y, z])));
}

// The outline of a geom on the screen: round ends are discs that face the camera.
function hullOf(pen, view, geom, pose) {
  const [a, b] = geom.size;
  const ends = geom.type === "sphere" ? [0] : geom.type === "capsule" ? [-b, b] : null;
  const seen = ends
    ? ends.flatMap((end) => {
      const [x, y, z] = view.see(placed(pose, [0, 0, end]));
      return CIRCLE.map(([right, above]) => [x + a * right, y + a * above, z]);
    })
    : (geom.points ??= surface(geom)).map((point) => view.see(placed(pose, point)));
  return seen.every(pen.isBefore) ? hull(seen.map(pen.pixel)) : [];
}

function solid(pen, view, geom, pose) {
  const outline = hullOf(pen, view, geom, pose);
  if (!outline.length) return;
  if (geom.type === "box") {
    for (const face of FACES) boxFace(pen, view, geom, pose, face);
    return;
  }
  pen.outline(outline, colour(geom.rgba, 1), colour(geom.rgba, 0.6));
}

// A face is seen where its outside is turned to the camera; light comes from above.
function boxFace(pen, view, geom, pose, { axis, sign }) {
  const normal = turned(pose, [0, 1, 2].map((i) => (i === axis ? sign : 0)));
  const [one, other] = [(axis + 1) % 3, (axis + 2) % 3];
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([u, v]) => {
    const corner = [0, 0, 0];
    corner[axis] = sign * geom.size[axis];
    corner[one] = u * geom.size[one];
    corner[other] = v * geom.size[other];
    return view.see(placed(pose, corner));
  });
  const [facing, centre] = [view.turn(normal), corners[0]];
  if (facing[0] * centre[0] + facing[1] * centre[1] + facing[2] * centre[2] > 0) return;
  const shade = 0.78 + 0.22 * normal[2] + 0.06 * normal[0];
  pen.outline(corners.map(pen.pixel), colour(geom.rgba, shade), colour(geom.rgba, 0.5));
}

// What a geom shades of a floor, under light from straight above it.
function shadow(pen, floor, { geom, pose }) {
  const [, , , w, ...u] = floor.pose;
  const points = (geom.points ??= surface(geom)).map((point) => {
    const world = placed(pose, point);
    const local = placed([0, 0, 0, w, ...u.map((value) => -value)], world.map((value, i) => value - floor.pose[i]));
    return placed(floor.pose, [local[0], local[1], 0]);
  });
  pen.patch(points, "rgba(0, 0, 0, .16)");
}

function grid(pen, geom, pose) {
  const [a, b] = [geom.size[0] || FLOOR, geom.size[1] || FLOOR].map((half) => Math.min(half, FLOOR));
  for (let i = -4; i <= 4; i++) {
    const x = (i / 4) * a, y = (i / 4) * b;
    pen.line(placed(pose, [x, -b, 0]), placed(pose, [x, b, 0]), "rgba(128, 128, 128, .35)", 1);
    pen.line(placed(pose, [-a, y, 0]), placed(pose, [a, y, 0]), "rgba(128, 128, 128, .35)", 1);
  }
}

function colour([r = 0.5, g = 0.5, b = 0.5, alpha = 1], shade) {
  const channel = (value) => Math.round(255 * Math.min(1, shade * value));
  return `rgba(${channel(r)}, ${channel(g)}, ${channel(b)}, ${alpha})`;
}
