// Where points of the world lie for MuJoCo's free camera, what the outline of a solid is, and how a pose turns a point.

export const plus = (a, b, factor = 1) => a.map((value, axis) => value + factor * b[axis]);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));
export const inverse = ([w, x, y, z]) => [w, -x, -y, -z];

// The camera looks from `distance` away at `target`, along azimuth and elevation [degrees].
// see(point) is [right, above, forward] of the camera; turn(vector) the same for a direction. Its eye and axes are there too.
export function viewFrom({ azimuth, elevation, distance, target }) {
  const [az, up] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
  const forward = [Math.cos(up) * Math.cos(az), Math.cos(up) * Math.sin(az), Math.sin(up)];
  const right = [Math.sin(az), -Math.cos(az), 0];
  const above = cross(right, forward);
  const eye = target.map((value, axis) => value - distance * forward[axis]);
  const turn = (v) => [dot(right, v), dot(above, v), dot(forward, v)];
  return { eye, right, above, forward, turn, see: (point) => turn([point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]]) };
}

// A vector turned by a quaternion (w, u): v + 2 w (u x v) + 2 u x (u x v).
export function rotated([w, ...u], v) {
  const once = cross(u, v), twice = cross(u, once);
  return v.map((value, axis) => value + 2 * (w * once[axis] + twice[axis]));
}

// A point of the geom's own frame in the world, and a direction.
export const placed = (pose, point) => plus(rotated(pose.slice(3, 7), point), pose);
export const turned = (pose, vector) => rotated(pose.slice(3, 7), vector);

// The convex hull of points of a plane, by Andrew's monotone chain.
export function hull(points) {
  const sorted = points.slice().sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  const half = (list) => {
    const chain = [];
    for (const p of list) {
      while (chain.length > 1 && side(chain[chain.length - 2], chain[chain.length - 1], p) <= 0) chain.pop();
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

const side = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
