// The measurements behind a verdict, as pictures. The kind of the exercise decides which keys there are.

import { chart } from "./chart.js";

const PICTURES = {
  angles: angleCharts, stability: stabilityChart, differences: differenceCharts, order: orderChart, charts: plainCharts,
};

export function evidenceFigures(evidence, findings) {
  const titleOf = (id) => findings.find((finding) => finding.id === id)?.title ?? id;
  return Object.entries(PICTURES).flatMap(([key, draw]) => (evidence[key] ? draw(evidence[key], titleOf) : []));
}

// Line charts of any kind of exercise, as chart.js takes them, each with the id of its trial as `case`.
function plainCharts(specs, titleOf) {
  return specs.map((spec) => chart({ ...spec, title: `${titleOf(spec.case)}: ${spec.title}` }));
}

// The angle against time at both ends of a claimed bracket, one picture for each case.
function angleCharts(runs, titleOf) {
  return Array.from(groups(runs, "case"), ([id, ends]) => {
    const reach = 1.2 * Math.max(...ends.map(settledReach));
    return chart({
      title: `${titleOf(id)}: the angle at both ends of your bracket`,
      x: { label: "time (s)" },
      y: { label: "angle (rad)", min: -reach, max: reach },
      series: ends.map((run) => ({
        faint: run.diverged,
        label: `${run.end}, ${run.timestep_ms.toPrecision(4)} ms${run.diverged ? ": diverges" : ""}`,
        x: run.time_s, y: run.angle,
      })),
    });
  });
}

// Clips a run that diverges, so that it does not flatten the others.
function settledReach(run) {
  const start = 2 * Math.abs(run.angle[0] ?? 1);
  return run.diverged ? start : run.angle.reduce((most, one) => Math.max(most, Math.abs(one)), 0.1);
}

function stabilityChart(lines, titleOf) {
  const known = lines.filter((line) => line.radius.length);
  if (!known.length) return [];
  return [chart({
    title: "Spectral radius of one step at rest: above 1, a small deviation grows without bound",
    x: { label: "timestep (ms)" },
    y: { label: "spectral radius", max: Math.min(2, Math.max(...known.flatMap((line) => line.radius), 1.05)) },
    series: known.map((line) => ({ label: titleOf(line.case), x: line.timestep_ms, y: line.radius })),
    marks: [{ y: 1 }],
  })];
}

// The distance from MuJoCo's RK4 on a logarithmic axis; no chart if it is zero everywhere.
function differenceCharts(cases, titleOf) {
  return cases.filter((one) => [...one.qpos, ...one.qvel].some((value) => value > 0)).map((one) => chart({
    title: `${titleOf(one.case)}: difference from MuJoCo's RK4`,
    x: { label: "time (s)" },
    y: { label: "largest difference", log: true },
    series: [
      { label: "positions", x: one.time_s, y: one.qpos },
      { label: "velocities", x: one.time_s, y: one.qvel },
    ],
    marks: [{ y: one.tolerance, label: "tolerance" }],
  }));
}

function orderChart(order) {
  const known = order.error.every((error) => error > 0);
  if (!known) return [];
  const last = order.timestep_ms.length - 1;
  const ideal = order.timestep_ms.map((h) => order.error[last] * (h / order.timestep_ms[last]) ** order.expected_slope);
  return [chart({
    title: order.slope === null ? "Error against the exact motion" : `Error against the exact motion: slope ${order.slope.toFixed(2)}`,
    x: { label: "timestep (ms)", log: true },
    y: { label: "error", log: true },
    series: [
      { label: "yours", x: order.timestep_ms, y: order.error, points: true },
      { label: `slope ${order.expected_slope}`, x: order.timestep_ms, y: ideal },
    ],
  })];
}

function groups(items, key) {
  const grouped = new Map();
  for (const item of items) grouped.set(item[key], [...(grouped.get(item[key]) ?? []), item]);
  return grouped;
}
