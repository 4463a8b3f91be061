// A scene of recorded geoms on a canvas: lit by the GPU, or painted without one, with overlays over it; and what lies under a
// pixel of it.

import { Light } from "./light.js";
import { drawOverlays } from "./overlays.js";
import { paint, paintGhost } from "./painting.js";
import { Pen } from "./pen.js";
import { dot, placed, plus, unit, viewFrom } from "./geometry.js";
import { pick, reachOf } from "./solids.js";

const DISTANCE = 1.7; // of the camera, in sizes of what it shows
const FOLLOWED = 4; // how many times larger than the solids themselves a motion may be to be shown whole
const SUN_BESIDE = 125, SUN_HIGH = 1.35; // degrees from the camera's azimuth, and how high in lengths of the way there
const TRAIL = "194, 112, 61", PULL = "#d9480f";

// Calls redraw() when a scene in the node would look otherwise: another size, other colours, or the GPU is back.
export function watchLooks(node, redraw) {
  const gone = new AbortController();
  const look = () => (node.isConnected ? redraw() : gone.abort());
  new ResizeObserver(redraw).observe(node);
  addEventListener("resize", look, gone);
  for (const query of ["(prefers-color-scheme: dark)", "(forced-colors: active)"]) matchMedia(query).addEventListener("change", look, gone);
}

export class Scene {
  // geoms: [{type, size: [3], rgba: [4], body, mesh}]; camera: {azimuth, elevation, distance, target} in degrees and metres,
  // where it leaves something out, so that `frames` fit: lists of poses, of which the first is the start.
  // `turning` is what the learner adds: degrees to azimuth and elevation, a factor to distance.
  constructor(canvas, geoms, camera, frames, turning) {
    this.canvas = canvas;
    this.geoms = geoms;
    this.around = fitting(geoms, frames);
    this.camera = { azimuth: 90, elevation: -20, distance: DISTANCE * this.around.size, target: this.around.target, ...camera };
    this.turning = turning;
    const beside = ((this.camera.azimuth + SUN_BESIDE) * Math.PI) / 180, ten = 10 ** Math.floor(Math.log10(this.camera.distance / 8));
    this.sun = unit([Math.cos(beside), Math.sin(beside), SUN_HIGH]);
    this.cell = ten * [1, 2, 5].findLast((step) => step <= Math.max(1, this.camera.distance / 8 / ten)); // of the floor [m]
  }

  get view() {
    const { azimuth, elevation, distance, target } = this.camera;
    const up = Math.min(89, Math.max(-89, elevation + this.turning.elevation));
    return viewFrom({ azimuth: azimuth + this.turning.azimuth, elevation: up, distance: distance * this.turning.distance, target });
  }

  // poses: one [x, y, z, qw, qx, qy, qz] per geom; `ghost` the same of the last run, `past` of frames before; `trail`: [[x, y, z], ...];
  // `over`: by overlay, the rows of this frame; `shown`: what is drawn over the scene; `forceScale` [m/N]; `pull`: {from, to} in the world;
  // `hasShadows`: whether the sun casts them.
  draw({ poses, ghost, past = [], trail = [], over = {}, shown = new Set(), forceScale = 0, pull, hasShadows = true }) {
    const { view } = this, pen = new Pen(this.canvas, view);
    this.poses = poses;
    const [solids, floors] = this.split(poses);
    const isLit = this.light(pen, view, solids, ghost ? this.split(ghost)[0] : [], floors, hasShadows);
    if (!isLit) paint(pen, view, { solids, floors, hasShadows: shown.has("shadows") });
    for (let i = 1; i < trail.length; i++) pen.line(trail[i - 1], trail[i], `rgba(${TRAIL}, ${0.15 + (0.7 * i) / trail.length})`, 1.5);
    for (const before of past) paintGhost(pen, view, this.geoms, before);
    if (ghost && !isLit) paintGhost(pen, view, this.geoms, ghost);
    drawOverlays(pen, over, shown, forceScale, this.camera.distance);
    if (pull) {
      pen.dot(pull.from, PULL);
      pen.arrow(pull.from, pull.to, PULL);
    }
  }

  // Pairs of a geom and its pose, as far as that is finite: the solids, and the floors.
  split(poses) {
    const there = this.geoms.map((geom, index) => [geom, poses[index]]).filter(([, pose]) => pose && !pose.includes(null));
    const isFloor = ([geom]) => geom.type === "plane";
    return [there.filter((pair) => !isFloor(pair)), there.filter(isFloor)];
  }

  // Whether the GPU has drawn it.
  light(pen, view, solids, ghosts, floors, hasShadows) {
    const { shared } = Light;
    if (!shared) return false;
    const { canvas: { width, height }, around: { target: middle, radius, low }, camera, turning, sun } = this;
    const lies = floors.map(([geom, pose]) => [{ size: geom.size, cell: this.cell, lay: 1 }, pose]);
    const catches = [[{ size: [0, 0], cell: 1, lay: 0 }, [0, 0, low - 0.06 * radius, 1, 0, 0, 0]]]; // shadows alone, where there is no floor
    const isDrawn = shared.draw({
      width, height, view, solids, ghosts, sun, hasShadows, around: { middle, radius }, floors: lies.length ? lies : catches,
      distance: camera.distance * turning.distance, ink: pen.soft.match(/[\d.]+/g).slice(0, 3).map((value) => value / 255),
    });
    if (isDrawn) pen.on.drawImage(shared.canvas, 0, shared.canvas.height - height, width, height, 0, 0, width, height);
    return isDrawn;
  }

  // The eye, the direction to a point of the screen, and the direction that the camera looks.
  rayTo(x, y) {
    const { eye, right, above, forward } = this.view, box = this.canvas.getBoundingClientRect();
    const zoom = Math.min(box.height, 1.2 * box.width) / 2 / Math.tan(Math.PI / 8);
    const way = plus(plus(forward, right, (x - box.left - box.width / 2) / zoom), above, -(y - box.top - box.height / 2) / zoom);
    return { eye, way: unit(way), forward };
  }

  // The movable geom under a point of the screen: {index, point} with the point in its own frame; null where there is none.
  pick(x, y) {
    const { eye, way } = this.rayTo(x, y), found = this.poses ? pick(this.geoms, this.poses, eye, way) : null;
    return found && this.geoms[found.index].body ? found : null;
  }

  // Where a point of a geom is now.
  placeOf({ index, point }) {
    return placed(this.poses[index], point);
  }

  // The point under a point of the screen, in the plane through `from` that faces the camera.
  pointBeside(from, x, y) {
    const { eye, way, forward } = this.rayTo(x, y);
    return plus(eye, way, dot(plus(from, eye, -1), forward) / dot(way, forward));
  }
}

// What shows the solids in these frames: their size, where to look, and how low they come. A motion that leads far away is not
// followed.
function fitting(geoms, frames) {
  const first = ends(geoms, frames.slice(0, 1)), whole = ends(geoms, frames);
  if (!Number.isFinite(first.size)) return { size: 2 / DISTANCE, radius: 1, low: 0, target: [0, 0, 0] };
  return whole.size <= FOLLOWED * first.size ? whole : first;
}

// The box around the solids in these frames: its largest side, its middle, half of its diagonal and its bottom.
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
  const sides = high.map((value, axis) => value - low[axis]);
  return { size: Math.max(...sides), radius: Math.hypot(...sides) / 2, low: low[2], target: high.map((value, axis) => (value + low[axis]) / 2) };
}
