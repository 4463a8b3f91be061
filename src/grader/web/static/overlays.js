// What lies over the bodies, so that what is inside or behind them is seen: frames, axes, contacts, forces, cameras.

import { placed } from "./geometry.js";

const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const AXIS_COLOURS = ["#c92a2a", "#2b8a3e", "#1864ab"];
const COLOURS = { joints: "#0b7285", com: "#862e9c", sites: "#2b8a3e", contacts: "#e8590c", forces: "#c2255c", cameras: "#5f3dc4" };
const CORNERS = [[-1, -0.75, -1.5], [1, -0.75, -1.5], [1, 0.75, -1.5], [-1, 0.75, -1.5]];

// over: by overlay, its rows in this frame; shown: the names to draw; forceScale: the length of a force's arrow [m/N];
// reach: the distance of the camera [m].
export function drawOverlays(pen, over, shown, forceScale, reach) {
  const size = 0.06 * reach;
  const rows = (name, from = name) => (shown.has(name) ? over[from] ?? [] : []).filter((row) => !row.includes(null));
  for (const pose of rows("frames")) {
    AXES.forEach((axis, i) => pen.arrow(pose, placed(pose, axis.map((value) => size * value)), AXIS_COLOURS[i]));
  }
  for (const [x, y, z, ...axis] of rows("joints")) {
    pen.arrow([x, y, z], [x, y, z].map((value, i) => value + 1.5 * size * axis[i]), COLOURS.joints);
  }
  for (const pose of rows("cameras")) pyramid(pen, pose, 0.7 * size);
  for (const name of ["com", "sites"]) for (const point of rows(name)) pen.dot(point, COLOURS[name]);
  for (const row of rows("contacts")) pen.dot(row.slice(0, 3), COLOURS.contacts);
  for (const row of rows("forces", "contacts")) {
    const point = row.slice(0, 3);
    pen.arrow(point, point.map((value, i) => value + forceScale * row[3 + i]), COLOURS.forces);
  }
}

// A camera looks along -z, with y up: the pyramid opens that way.
function pyramid(pen, pose, size) {
  const corners = CORNERS.map((corner) => placed(pose, corner.map((value) => size * value)));
  corners.forEach((corner, i) => {
    pen.line(pose, corner, COLOURS.cameras, 1.5);
    pen.line(corner, corners[(i + 1) % 4], COLOURS.cameras, 1.5);
  });
  pen.dot(pose, COLOURS.cameras);
}

// The scale [m/N] that draws the largest contact force of the run as a quarter of what the camera sees.
export function fittingForces(frames, reach) {
  let largest = 0;
  for (const contacts of frames) for (const [, , , ...force] of contacts) largest = Math.max(largest, Math.hypot(...force));
  return largest ? (0.25 * reach) / largest : 0;
}
