// Unit solids as triangles, and how they become the drawn geoms. A row is a point, its normal, and the end of a capsule
// (-1, 0 or 1) with which the point moves.

import { cross, dot, inverse, plus, rotated, unit } from "./geometry.js";

export const ROW = 7;
const TURN = 2 * Math.PI;
const SMOOTH = 0.7; // of a mesh: normals whose cosine is less stay apart, so that an edge is sharp

// A profile of [radius, height, its normal's two parts, end], turned around z.
function lathe(profile, around) {
  const rows = [], faces = [], high = profile.length;
  for (let i = 0; i <= around; i++) {
    const c = Math.cos((TURN * i) / around), s = Math.sin((TURN * i) / around);
    for (const [radius, z, out, up, end = 0] of profile) rows.push(radius * c, radius * s, z, out * c, out * s, up, end);
    if (i === around) break;
    for (let j = 0; j < high - 1; j++) {
      const a = i * high + j;
      faces.push(a, a + high, a + 1, a + 1, a + high, a + high + 1);
    }
  }
  return { rows, faces };
}

function box() {
  const rows = [], faces = [];
  for (const axis of [0, 1, 2]) for (const sign of [-1, 1]) {
    const normal = [0, 0, 0], first = rows.length / ROW;
    normal[axis] = sign;
    for (const [u, v] of [[-1, -1], [sign, -sign], [1, 1], [-sign, sign]]) {
      const point = normal.slice();
      point[(axis + 1) % 3] = u;
      point[(axis + 2) % 3] = v;
      rows.push(...point, ...normal, 0);
    }
    faces.push(first, first + 1, first + 2, first, first + 2, first + 3);
  }
  return { rows, faces };
}

function ball(around, isSplit) {
  const rings = around / 2, arc = [];
  for (let i = 0; i <= rings; i++) {
    const at = Math.PI * (i / rings - 0.5), s = Math.sin(at), c = Math.cos(at);
    if (isSplit && 2 * i === rings) arc.push([1, 0, 1, 0, -1], [1, 0, 1, 0, 1]);
    else arc.push([c, s, c, s, isSplit ? Math.sign(s) : 0]);
  }
  return lathe(arc, around);
}

// The triangles of a mesh, whose normals are those of the faces around a corner that look nearly the same way.
function triangles({ vertices, faces }) {
  const corner = (index) => vertices.slice(3 * index, 3 * index + 3), around = new Map(), flat = [], rows = [];
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map((i) => corner(faces[f + i]));
    flat.push(unit(cross(plus(b, a, -1), plus(c, a, -1))));
    for (const index of faces.slice(f, f + 3)) {
      if (!around.has(index)) around.set(index, []);
      around.get(index).push(f / 3);
    }
  }
  faces.forEach((index, i) => {
    const own = flat[Math.floor(i / 3)], alike = around.get(index).map((face) => flat[face]).filter((normal) => dot(normal, own) > SMOOTH);
    rows.push(...corner(index), ...unit(alike.reduce((sum, normal) => plus(sum, normal), [0, 0, 0])), 0);
  });
  const reach = Math.max(...faces.map((index) => Math.hypot(...corner(index))));
  return { rows, faces: faces.map((_, i) => i), reach };
}

const solids = new Map();

// The triangles of a geom, with as many corners around a round one. They are kept by what they are made of: every run brings its
// geoms anew, and the renderer keeps what it has been given of a solid.
export function solidOf(geom, around = 20) {
  const { mesh } = geom, key = mesh ? (geom.key ??= `${mesh.vertices};${mesh.faces}`) : `${geom.type} ${around}`;
  if (!solids.has(key)) solids.set(key, mesh ? triangles(mesh) : makeSolid(geom.type, around));
  return solids.get(key);
}

function makeSolid(type, around) {
  if (type === "cylinder") return lathe([[0, -1, 0, -1], [1, -1, 0, -1], [1, -1, 1, 0], [1, 1, 1, 0], [1, 1, 0, 1], [0, 1, 0, 1]], around);
  if (type === "cone") return lathe([[0, -1, 0, -1], [1, -1, 0, -1], [1, -1, 0.9, 0.45], [0, 1, 0.9, 0.45]], around);
  return type === "sphere" || type === "ellipsoid" ? ball(around, false) : type === "capsule" ? ball(around, true) : box();
}

// How a unit solid becomes the geom: factors along its axes, and how far the ends of a capsule are.
export function scaleOf({ type, mesh, size: [a = 0, b = 0, c = 0] }) {
  if (mesh) return [1, 1, 1, 0];
  if (type === "sphere") return [a, a, a, 0];
  if (type === "capsule") return [a, a, a, b];
  return type === "cylinder" || type === "cone" ? [a, a, b, 0] : [a, b, c, 0];
}

// The radius of the ball around a geom.
export function reachOf(geom) {
  const { type, size: [a = 0, b = 0, c = 0] } = geom;
  if (geom.mesh) return solidOf(geom).reach;
  if (type === "capsule") return a + b;
  if (type === "cylinder" || type === "cone") return Math.hypot(a, b);
  if (type !== "sphere" && type !== "ellipsoid") return Math.hypot(a, b, c);
  return Math.max(a, b, c);
}

// Where a ray meets a triangle, in lengths of its way; negative where it does not. Source: Möller and Trumbore, 1997.
function meet(from, way, a, b, c) {
  const one = plus(b, a, -1), other = plus(c, a, -1), p = cross(way, other), det = dot(one, p);
  if (Math.abs(det) < 1e-14) return -1;
  const s = plus(from, a, -1), u = dot(s, p) / det, q = cross(s, one), v = dot(way, q) / det;
  return u < 0 || v < 0 || u + v > 1 ? -1 : dot(other, q) / det;
}

// The first geom that a ray meets: {index, point}, the point in the geom's frame; null where there is none.
export function pick(geoms, poses, eye, way) {
  let best = null;
  geoms.forEach((geom, index) => {
    const pose = poses[index];
    if (geom.type === "plane" || !pose || pose.includes(null)) return;
    const middle = plus(pose.slice(0, 3), eye, -1), along = dot(middle, way);
    if (dot(middle, middle) - along * along > reachOf(geom) ** 2) return;
    const back = inverse(pose.slice(3)), from = rotated(back, middle.map((value) => -value)), to = rotated(back, way);
    const [a, b, c, shift] = scaleOf(geom), { rows, faces } = solidOf(geom);
    const at = (i) => [a * rows[ROW * i], b * rows[ROW * i + 1], c * rows[ROW * i + 2] + shift * rows[ROW * i + 6]];
    for (let f = 0; f < faces.length; f += 3) {
      const far = meet(from, to, at(faces[f]), at(faces[f + 1]), at(faces[f + 2]));
      if (far > 0 && far < (best?.far ?? Infinity)) best = { far, index, point: plus(from, to, far) };
    }
  });
  return best && { index: best.index, point: best.point };
}
