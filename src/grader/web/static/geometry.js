// Where points of the world lie for MuJoCo's free camera, what the outline of a solid is, and how a pose turns a point.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// The camera looks from `distance` away at `target`, along azimuth and elevation [degrees].
// see(point) is [right, above, forward] of the camera; turn(vector) the same for a direction.
export function viewFrom({ azimuth, elevation, distance, target }) {
  const [az, up] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
  const forward = [Math.cos(up) * Math.cos(az), Math.cos(up) * Math.sin(az), Math.sin(up)];
  const right = [Math.sin(az), -Math.cos(az), 0];
  const above = cross(right, forward);
  const eye = target.map((value, axis) => value - distance * forward[axis]);
  const turn = (v) => [dot(right, v), dot(above, v), dot(forward, v)];
  return { turn, see: (point) => turn([point[0] - eye[0], point[1] - eye[1], point[2] - eye[2]]) };
}

// A point of the geom's own frame in the world: v + 2 w (u x v) + 2 u x (u x v) for the quaternion (w, u).
export function placed([x, y, z, w, ...u], point) {
  const once = cross(u, point), twice = cross(u, once);
  return [x + point[0] + 2 * (w * once[0] + twice[0]), y + point[1] + 2 * (w * once[1] + twice[1]), z + point[2] + 2 * (w * once[2] + twice[2])];
}

export const turned = (pose, vector) => placed([0, 0, 0, ...pose.slice(3)], vector);

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
