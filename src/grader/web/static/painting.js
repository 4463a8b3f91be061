// Paints a scene without a GPU: flat solids, the farthest first, with their shadows from straight above.

import { hull, placed, turned } from "./geometry.js";

const CIRCLE = Array.from({ length: 24 }, (_, i) => [Math.cos((2 * Math.PI * i) / 24), Math.sin((2 * Math.PI * i) / 24)]);
const BALL = [-0.9, -0.5, 0, 0.5, 0.9].flatMap((z) => CIRCLE.map(([x, y]) => [x * Math.sqrt(1 - z * z), y * Math.sqrt(1 - z * z), z]))
  .concat([[0, 0, -1], [0, 0, 1]]);
const FACES = [0, 1, 2].flatMap((axis) => [-1, 1].map((sign) => ({ axis, sign })));
const FLOOR = 2; // how much of an endless plane is drawn [m]

// solids and floors: lists of [geom, pose].
export function paint(pen, view, { solids, floors, hasShadows }) {
  for (const [geom, pose] of floors) grid(pen, geom, pose);
  if (hasShadows) for (const [, pose] of floors) for (const solid of solids) shadow(pen, pose, solid);
  const deep = solids.map(([geom, pose]) => ({ geom, pose, depth: view.see(pose)[2] })).sort((a, b) => b.depth - a.depth);
  for (const { geom, pose } of deep) solid(pen, view, geom, pose);
}

// The outlines of solids at earlier poses.
export function paintGhost(pen, view, geoms, poses) {
  geoms.forEach((geom, index) => {
    if (geom.type === "plane" || !poses[index] || poses[index].includes(null)) return;
    pen.outline(hullOf(pen, view, geom, poses[index]), null, pen.soft, [3, 4]);
  });
}

// Sizes as in MuJoCo: half lengths; the long axis of capsule and cylinder is z.
function surface({ type, mesh, size: [a = 0, b = 0, c = 0] }) {
  if (mesh) return Array.from({ length: mesh.vertices.length / 3 }, (_, i) => mesh.vertices.slice(3 * i, 3 * i + 3));
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
function shadow(pen, floor, [geom, pose]) {
  const [, , , w, ...u] = floor;
  const points = (geom.points ??= surface(geom)).map((point) => {
    const world = placed(pose, point);
    const local = placed([0, 0, 0, w, ...u.map((value) => -value)], world.map((value, i) => value - floor[i]));
    return placed(floor, [local[0], local[1], 0]);
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
