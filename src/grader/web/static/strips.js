// What a run's plots show: the strips of the chart, in the colours of its integrator, beside those of the last run.

import { seriesClass } from "./chart.js";
import { seconds } from "./dom.js";
import { calmPart } from "./scale.js";

const EVENT_PART = 0.15, AFTERWARDS = 2.2; // of the whole run; in times of the event
const LOG_RANGE = 1e4;
const FAR = 3;
const READOUTS_MAX = 2;
const STRIP = 132; // the height of a plot for which the author asks none, beside others [px]
export const DIVERGED = /^BAD/;

// The first warning for the chart: MuJoCo resets a state that diverged.
export function warningOf(run) {
  const [first] = run.warnings;
  return first && { ...first, resets: DIVERGED.test(first.kind), text: `${first.kind} ${seconds(first.time)}` };
}

// How much of a run is shown [s]: all of it, or the surroundings of what ended it early.
export function spanOf(run) {
  const whole = run.times.at(-1), warning = warningOf(run);
  return warning?.resets && warning.time < EVENT_PART * whole ? Math.min(whole, AFTERWARDS * warning.time) : whole;
}

// `className` is that of the integrator, `integrator` its name, where the lab lets the learner choose it.
export function stripsOf(run, ghost, integrator) {
  const ghosts = ghost && plotsOf(ghost);
  return plotsOf(run).map((plot, index) => stripOf(plot, run, { plot: ghosts?.[index], times: ghost?.times ?? [] }, integrator));
}

// The author's plots; without them, the readouts that move.
function plotsOf(run) {
  if (run.plots.length) return run.plots;
  return run.readouts.filter((readout) => readout.values.some((value) => value !== null) && !isClock(readout.values, run))
    .slice(0, READOUTS_MAX)
    .map(({ label, unit, values }) => ({ ylabel: unit ? `${label} (${unit})` : label, refLines: [], traces: [{ label: "", values }] }));
}

const isClock = (values, { times }) => values.every((value, i) => value === null || Math.abs(value - times[i]) < 1e-3 || value < times[i])
  && values.some((value, i) => i && value !== null && Math.abs(value - times[i]) < 1e-3);

function stripOf(plot, run, last, integrator) {
  const warning = warningOf(run), reset = warning?.resets ? warning.time : Infinity;
  const own = plot.traces.map(({ values }) => values.filter((_, i) => run.times[i] <= reset));
  const before = own.flat().filter((value) => value !== null);
  const others = (last.plot?.traces ?? []).flatMap(({ values }) => values.filter((value) => value !== null));
  const lines = plot.refLines.map((line) => (typeof line === "number" ? { y: line } : line)).filter((line) => typeof line.y === "number");
  const axis = { min: plot.ymin ?? undefined, max: plot.ymax ?? undefined, log: isWide(plot, before) };
  const calm = reset < Infinity && !axis.log ? own.flatMap(calmPart) : before;
  const alone = plot.traces.length === 1;
  return {
    label: plot.ylabel || (alone ? plot.traces[0].label : ""),
    weight: plot.height ?? STRIP,
    axis,
    shows: [...calm, ...(axis.log || reset < Infinity || isFar(others, calm) ? [] : others), ...(axis.log ? [] : lines.map((line) => line.y))],
    lines,
    series: plot.traces.map(({ label, dash, values }, index) => ({
      label: alone ? integrator ?? (plot.ylabel ? label : "") : label,
      className: alone && integrator ? integrator : seriesClass(index),
      dash, values, times: run.times,
    })),
    ghost: (last.plot?.traces ?? []).map(({ values }) => ({ values, times: last.times })),
  };
}

// Whether the last run would leave no room for this one: the axis is that of this run.
function isFar(others, own) {
  const width = (values) => values.reduce((widest, value) => Math.max(widest, Math.abs(value)), 0);
  return width(others) > FAR * width(own);
}

// Whether a plot needs a logarithmic axis: its positive values, such as energies, span many decades.
function isWide({ ymin, ymax }, values) {
  if ((ymin ?? null) !== null || (ymax ?? null) !== null || values.length < 2) return false;
  const positive = values.filter((value) => value > 0);
  if (positive.length < values.length) return false;
  return Math.max(...positive) / Math.min(...positive) > LOG_RANGE;
}
