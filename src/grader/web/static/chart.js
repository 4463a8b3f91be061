// Strips over one time axis as SVG: lines with their names at them, the last run, reference lines, a flag and a cursor.

import { number, svg } from "./dom.js";
import { scaleOf, steps } from "./scale.js";

const LEFT = 58, RIGHT = 10, HEAD = 24, AXIS = 26, NAME = 16;
const COLOURS = 6;
const SAME = 0.004; // of a strip's height: closer lines cannot be told apart

// spec: {begin (0), end [s or of another axis], xlabel, strips: [{label, weight, axis: {min, max, log}, shows: [values], lines: [{y, label}],
//   series: [{label, className, dash, times, values}], ghost: [{times, values}]}], warning: {time, text, resets}}.
// Fills the picture; its size does not change. Returns {moveCursor(time), timeAt(clientX)}; null off the page.
export function drawChart(picture, spec) {
  const width = picture.clientWidth, height = picture.clientHeight;
  if (!width) return null; // the lab has left the page
  const { begin = 0, end } = spec;
  const across = (time) => LEFT + ((width - LEFT - RIGHT) * (time - begin)) / (end - begin);
  const floor = height - AXIS;
  const flagged = spec.warning && spec.warning.time <= end;
  const cut = flagged && spec.warning.resets ? spec.warning.time : Infinity;
  picture.replaceChildren();
  if (cut < Infinity) picture.append(svg("rect", { class: "shade", x: across(cut), y: HEAD, width: width - RIGHT - across(cut), height: floor - HEAD }));
  const weights = spec.strips.reduce((sum, strip) => sum + strip.weight, 0);
  let top = 0;
  for (const strip of spec.strips) {
    const bottom = top + (floor * strip.weight) / weights;
    picture.append(...drawStrip(strip, { across, left: LEFT, right: width - RIGHT, top: top + HEAD, bottom, end, cut }));
    top = bottom;
  }
  picture.append(...timeAxis(spec, across, floor, width));
  if (flagged) picture.append(...flag(spec.warning, across(spec.warning.time), floor, width));
  const cursor = svg("path", { class: "cursor", visibility: "hidden" });
  picture.append(cursor);
  return {
    moveCursor(time) {
      cursor.setAttribute("d", `M${across(Math.min(time, end)).toFixed(1)} ${HEAD}V${floor}`);
      cursor.setAttribute("visibility", "visible");
    },
    timeAt: (clientX) => Math.min(1, Math.max(0, (clientX - picture.getBoundingClientRect().left - LEFT) / (width - LEFT - RIGHT))) * (end - begin) + begin,
  };
}

function timeAxis({ begin = 0, end, xlabel }, across, floor, width) {
  const ticks = steps(begin, end, width < 480 ? 4 : 7);
  const last = xlabel || (Math.abs(ticks.at(-1) - end) < 1e-6 * end ? `${number(end)} s` : "s");
  const parts = ticks.filter((tick) => across(tick) < width - RIGHT - 14 - 7 * last.length).map((tick) =>
    svg("text", { x: across(tick), y: floor + 18, "text-anchor": "middle" }, number(tick)));
  return [svg("path", { class: "axis", d: `M${LEFT} ${floor}H${width - RIGHT}${ticks.map((tick) => `M${across(tick)} ${floor}v4`).join("")}` }), ...parts,
    svg("text", { x: width - RIGHT, y: floor + 18, "text-anchor": "end" }, last)];
}

function drawStrip(strip, box) {
  const scale = scaleOf(strip.axis, strip.shows);
  const up = (value) => box.bottom - (box.bottom - box.top) * Math.min(60, Math.max(-60, scale.place(value)));
  const ticks = scale.ticks(box.bottom - box.top > 120 ? 5 : 3);
  const parts = ticks.flatMap((tick) => [
    svg("path", { class: "grid", d: `M${box.left} ${up(tick)}H${box.right}` }),
    svg("text", { x: box.left - 8, y: up(tick) + 4, "text-anchor": "end" }, number(tick))]);
  parts.push(svg("text", { x: 0, y: box.top - 10 }, strip.label + (scale.log ? ", log" : "")));
  for (const line of strip.lines) parts.push(...reference(line, up, box));
  const inside = svg("svg", { x: box.left, y: box.top - 2, width: box.right - box.left, height: box.bottom - box.top + 4 });
  inside.setAttribute("viewBox", `${box.left} ${box.top - 2} ${box.right - box.left} ${box.bottom - box.top + 4}`);
  for (const series of strip.ghost) inside.append(svg("path", { class: "ghost", d: pathOf(series, box, up, Infinity) }));
  const groups = together(strip.series, scale);
  for (const [first] of groups) inside.append(svg("path", { class: `line ${first.className}`, "stroke-dasharray": dashOf(first), d: pathOf(first, box, up, box.cut) }));
  return [...parts, inside, ...names(groups, box, up)];
}

function reference({ y, label }, up, { left, right, top, bottom }) {
  const at = up(y);
  if (at < top || at > bottom) return [];
  return [svg("path", { class: "reference", d: `M${left} ${at}H${right}` }),
    svg("text", { class: "halo", x: left + 4, y: at < top + 14 ? at + 13 : at - 4 }, label ?? "")];
}

function pathOf({ times, values }, { across, end }, up, cut) {
  let d = "", pen = "M";
  for (let i = 0; i < times.length && times[i] <= end * (1 + 1e-9); i++) {
    if (times[i] > cut * (1 + 1e-9)) break;
    const y = values[i] === null ? NaN : up(values[i]);
    if (!Number.isFinite(y)) { pen = "M"; continue; }
    d += `${pen}${across(times[i]).toFixed(1)} ${y.toFixed(1)}`;
    pen = "L";
  }
  return d;
}

const dashOf = ({ dash }) => (Array.isArray(dash) ? dash.join(" ") : dash ? "6 4" : null);

// The series in groups of which nobody could tell the lines apart.
function together(series, scale) {
  const groups = [];
  for (const line of series) {
    const group = groups.find(([first]) => coincide(first, line, scale));
    if (group) group.push(line);
    else groups.push([line]);
  }
  return groups;
}

function coincide(one, other, { place }) {
  if (one.values.length !== other.values.length) return false;
  return one.values.every((value, i) => {
    const [a, b] = [value, other.values[i]].map((each) => (each === null ? NaN : place(each)));
    return Object.is(a, b) || Math.abs(a - b) <= SAME;
  });
}

// Each name at the end of its line, those that would overlap moved apart.
function names(groups, box, up) {
  const placed = [];
  const right = Math.min(box.right, box.across(box.cut) || box.right) - 6;
  for (const group of groups) {
    const [first] = group, named = group.map((line) => line.label).filter(Boolean);
    const last = first.values.findLastIndex((value, i) => value !== null && Number.isFinite(up(value)) && first.times[i] <= box.end && first.times[i] <= box.cut);
    if (!named.length || last < 0 || right < box.left + 7 * named.join(" = ").length) continue;
    const at = Math.min(box.bottom - 5, Math.max(box.top + 12, up(first.values[last]) - 6));
    placed.push({ at, text: named.length > 1 ? `${named.join(" = ")} here` : named[0], className: first.className });
  }
  placed.sort((a, b) => a.at - b.at);
  placed.forEach((name, i) => { if (i) name.at = Math.max(name.at, placed[i - 1].at + NAME); });
  const over = placed.length ? Math.max(0, placed.at(-1).at - box.bottom + 5) : 0;
  return placed.map(({ at, text, className }) => svg("text", { class: `name halo ${className}`, x: right, y: at - over, "text-anchor": "end" }, text));
}

function flag({ text, resets }, x, floor, width) {
  const room = width - RIGHT - x, onLeft = room < 9 * text.length && x > width / 2, way = onLeft ? -1 : 1;
  const parts = [svg("path", { class: "fault-line", d: `M${x} 4V${floor}` }), svg("path", { class: "fault", d: `M${x} 4l${11 * way} 5l${-11 * way} 5z` }),
    svg("text", { class: "fault halo", x: x + 16 * way, y: 14, "text-anchor": onLeft ? "end" : "start" }, text)];
  if (resets && room > 60) {
    const centre = { x: x + room / 2, "text-anchor": "middle" };
    parts.push(svg("text", { ...centre, class: "name halo", y: 44 }, room > 190 ? "reset by MuJoCo" : "reset"));
    if (room > 210) parts.push(svg("text", { ...centre, class: "halo", y: 62 }, "no longer the run you set up"));
  }
  return parts;
}

export const seriesClass = (index) => `series-${index % COLOURS}`;
