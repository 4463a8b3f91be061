// A line chart as SVG: series against x, linear or logarithmic, with marked values.
// chart({ title, height, x: {label, log}, y: {label, log, min, max}, series: [{label, x, y, dash, points, faint}], marks: [{x | y, label}] })

import { el, number, svg } from "./dom.js";

const WIDTH = Math.min(640, Math.max(300, window.innerWidth - 80)); // text keeps its size on a narrow screen
const HEIGHT = 260, LEFT = 62, RIGHT = 14, TOP = 12, BOTTOM = 40;
const COLOURS = 6;

export function chart(spec) {
  const across = scale(spec.x, values(spec, "x"), LEFT, WIDTH - RIGHT);
  const floor = (spec.height ? Math.max(120, spec.height) : HEIGHT) - BOTTOM;
  const up = scale(spec.y, values(spec, "y"), floor, TOP);
  const picture = svg("svg", { class: "chart", viewBox: `0 0 ${WIDTH} ${floor + BOTTOM}`, role: "img", "aria-label": described(spec) });
  picture.append(...gridX(across, spec.x, floor), ...gridY(up, spec.y), frame(floor));
  for (const mark of spec.marks ?? []) picture.append(...marked(mark, across, up));
  const layers = spec.series.map((line, index) => [line, drawn(line, index, across, up)]);
  layers.sort(([a], [b]) => Boolean(b.faint) - Boolean(a.faint)); // faint ones lie underneath
  for (const [, parts] of layers) picture.append(...parts);
  const figure = el("figure", {}, spec.title ? el("figcaption", {}, spec.title) : null, picture, legend(spec.series));
  figure.moveCursor = cursorOn(picture, across, floor);
  return figure;
}

function values(spec, axis) {
  const all = spec.series.flatMap((line) => Array.from(line[axis])).concat((spec.marks ?? []).map((mark) => mark[axis]));
  return all.filter((value) => Number.isFinite(value) && (!spec[axis]?.log || value > 0));
}

function scale(axis = {}, all, from, to) {
  const turn = axis.log ? Math.log10 : (value) => value;
  let low = turn(axis.min ?? all.reduce((a, b) => Math.min(a, b), Infinity));
  let high = turn(axis.max ?? all.reduce((a, b) => Math.max(a, b), -Infinity));
  if (!Number.isFinite(low) || !Number.isFinite(high)) [low, high] = [0, 1];
  if (high - low < 1e-12 * Math.max(1, Math.abs(high))) [low, high] = [low - 0.5, high + 0.5];
  if (axis.log) [low, high] = [low - 0.05 * (high - low), high + 0.05 * (high - low)];
  const place = (value) => from + ((turn(value) - low) / (high - low)) * (to - from);
  return { place, ticks: axis.log ? decades(low, high) : steps(low, high), from, to };
}

function steps(low, high) {
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= raw * 0.999);
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) ticks.push(Number((i * step).toPrecision(12)));
  return ticks;
}

function decades(low, high) {
  const whole = [];
  const stride = Math.max(1, Math.ceil((high - low) / 7));
  for (let power = Math.ceil(low - 1e-9); power <= high + 1e-9; power += stride) whole.push(10 ** power);
  if (whole.length >= 3) return whole;
  const powers = Array.from({ length: Math.ceil(high) - Math.floor(low) + 1 }, (_, i) => 10 ** (Math.floor(low) + i));
  return powers.flatMap((power) => [power, 2 * power, 5 * power])
    .map((value) => Number(value.toPrecision(6)))
    .filter((value) => Math.log10(value) >= low && Math.log10(value) <= high);
}

function gridX(across, axis, floor) {
  const lines = across.ticks.flatMap((tick) => {
    const x = across.place(tick);
    return [
      svg("line", { class: "grid", x1: x, x2: x, y1: TOP, y2: floor }),
      svg("text", { x, y: floor + 15, "text-anchor": "middle" }, number(tick)),
    ];
  });
  const label = svg("text", { x: (LEFT + WIDTH - RIGHT) / 2, y: floor + BOTTOM - 6, "text-anchor": "middle" }, axis?.label ?? "");
  return [...lines, label];
}

function gridY(up, axis) {
  const lines = up.ticks.flatMap((tick) => {
    const y = up.place(tick);
    return [
      svg("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y }),
      svg("text", { x: LEFT - 6, y: y + 4, "text-anchor": "end" }, number(tick)),
    ];
  });
  const middle = (TOP + up.from) / 2;
  const label = svg("text", { x: 12, y: middle, "text-anchor": "middle", transform: `rotate(-90 12 ${middle})` }, axis?.label ?? "");
  return [...lines, label];
}

function frame(floor) {
  return svg("path", { class: "frame", d: `M${LEFT} ${TOP}V${floor}H${WIDTH - RIGHT}` });
}

function marked(mark, across, up) {
  if (mark.x !== undefined) {
    const x = across.place(mark.x);
    const onLeft = x > (LEFT + WIDTH) / 2;
    return [
      svg("line", { class: "mark-line", x1: x, x2: x, y1: TOP, y2: up.from }),
      svg("text", { x: x + (onLeft ? -4 : 4), y: TOP + 10, "text-anchor": onLeft ? "end" : "start" }, mark.label ?? ""),
    ];
  }
  const y = up.place(mark.y);
  return [
    svg("line", { class: "mark-line", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y }),
    svg("text", { x: WIDTH - RIGHT - 4, y: y < TOP + 14 ? y + 12 : y - 4, "text-anchor": "end" }, mark.label ?? ""),
  ];
}

// A vertical line at the time that the player shows.
function cursorOn(picture, across, floor) {
  const line = svg("line", { class: "cursor", y1: TOP, y2: floor, x1: LEFT, x2: LEFT, visibility: "hidden" });
  picture.append(line);
  return (x) => {
    for (const end of ["x1", "x2"]) line.setAttribute(end, across.place(x));
    line.setAttribute("visibility", "visible");
  };
}

const DASHES = ["none", "6 3", "2 3", "8 3 2 3", "12 4", "4 2"];

function dashOf(line, index) {
  if (Array.isArray(line.dash)) return line.dash.join(" ");
  if (line.dash) return "6 4";
  return line.faint ? "none" : DASHES[index % DASHES.length];
}

function drawn(line, index, across, up) {
  const inside = (y) => Math.min(Math.max(y, TOP - 1), up.from + 1);
  let d = "", pen = "M";
  const points = [];
  for (let i = 0; i < line.x.length; i++) {
    const x = across.place(line.x[i]), y = up.place(line.y[i]);
    if (line.x[i] === null || line.y[i] === null || !Number.isFinite(x) || !Number.isFinite(y)) { pen = "M"; continue; }
    d += `${pen}${x.toFixed(1)} ${inside(y).toFixed(1)}`;
    pen = "L";
    if (line.points) points.push(svg("circle", { class: `line series-${index % COLOURS}`, cx: x, cy: inside(y), r: 3 }));
  }
  return [svg("path", { class: `line series-${index % COLOURS}${line.faint ? " faint" : ""}`, d, "stroke-dasharray": dashOf(line, index) }), ...points];
}

// Every line has its own dashes, for readers who cannot distinguish the colours.
function legend(series) {
  const named = series.filter((line) => line.label);
  if (!named.length) return null;
  return el("ul", { class: "legend" }, series.map((line, index) => line.label && el("li", {},
    svg("svg", { viewBox: "0 0 24 10", "aria-hidden": "true" },
      svg("path", { class: `line series-${index % COLOURS}`, d: "M0 5H24", "stroke-dasharray": dashOf(line, index) })),
    line.label)));
}

function described(spec) {
  const lines = spec.series.map((line) => line.label).filter(Boolean).join(", ");
  const marks = (spec.marks ?? []).map((mark) => mark.label).filter(Boolean).join(", ");
  return [spec.title, `${spec.y?.label ?? "value"} against ${spec.x?.label ?? "time"}`, lines, marks].filter(Boolean).join("; ");
}
