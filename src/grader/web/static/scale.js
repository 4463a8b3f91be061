// Axes: where a value lies between the ends of an axis, its ticks, and where an axis is cut.

const DECADES_MAX = 12;
const PAD = 1.4; // what a cut axis shows beyond the calm part of a run
const WILD = 30; // how many times wider than its beginning a run may be before its axis is cut

// axis: {min, max, log}; calm: the values that the axis must show. place(value) is 0 at the lower end and 1 at the upper.
export function scaleOf({ min, max, log }, calm) {
  const turn = log ? (value) => Math.log10(value) : (value) => value;
  const shown = calm.filter((value) => Number.isFinite(value) && (!log || value > 0));
  let high = turn(max ?? shown.reduce((a, b) => Math.max(a, b), -Infinity));
  let low = turn(min ?? shown.reduce((a, b) => Math.min(a, b), Infinity));
  if (!Number.isFinite(low) || !Number.isFinite(high)) [low, high] = log ? [-1, 0] : [0, 1];
  if (log) [low, high] = [Math.max(Math.floor(low + 0.3), Math.ceil(high) - DECADES_MAX), Math.ceil(high - 0.02)];
  if (high - low < 1e-9 * Math.max(1, Math.abs(high))) [low, high] = [low - (log ? 1 : 0.5), high + (log ? 1 : 0.5)];
  if (!log && min === undefined && max === undefined) [low, high] = [low - 0.06 * (high - low), high + 0.06 * (high - low)];
  return { log, place: (value) => (turn(value) - low) / (high - low), ticks: (count) => (log ? decades(low, high, count) : steps(low, high, count)) };
}

export function steps(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= raw * 0.999);
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) ticks.push(Number((i * step).toPrecision(12)));
  return ticks;
}

export function decades(low, high, count = 7) {
  const stride = Math.max(1, Math.ceil((high - low) / count)), ticks = [];
  for (let power = Math.ceil(low - 1e-9); power <= high + 1e-9; power += stride) ticks.push(10 ** power);
  return ticks;
}

// The values that an axis must show of a run that diverged: the calm part of it, padded. Growth leaves such an axis steeply.
export function calmPart(values) {
  const finite = values.filter(Number.isFinite);
  const ends = (part) => {
    const first = finite.slice(0, Math.max(2, Math.ceil(part * finite.length)));
    return [Math.min(...first), Math.max(...first)];
  };
  const [most, begin] = [ends(0.6), ends(0.1)];
  const width = ([low, high]) => Math.max(high - low, Math.abs(high), Math.abs(low));
  const [low, high] = width(most) <= WILD * width(begin) ? most : begin;
  const reach = PAD * Math.max(Math.abs(low), Math.abs(high));
  return low < 0 || reach === 0 ? [-reach, reach] : [0, reach];
}
