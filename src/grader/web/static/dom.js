// Building elements: text is always text, never HTML.

const SVG = "http://www.w3.org/2000/svg";

export function el(name, attributes = {}, ...children) {
  return fill(document.createElement(name), attributes, children);
}

export function svg(name, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}

function fill(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return node;
}

export function number(value, digits = 4) {
  if (typeof value !== "number") return String(value);
  if (!Number.isFinite(value)) return value > 0 ? "∞" : value < 0 ? "−∞" : "not a number";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(digits - 1) : String(Number(value.toPrecision(digits)));
  const [mantissa, exponent] = text.split("e");
  if (exponent === undefined) return text.replace("-", "−");
  const factor = mantissa.replace("-", "−").replace(/\.0+$|(\.\d*?)0+$/, "$1");
  return `${factor === "1" ? "" : `${factor}·`}10${superscript(exponent)}`;
}

// A time as sliders and axes write it: in seconds, without a power of ten.
export const seconds = (time, digits = 4) => `${Number(time.toPrecision(digits))}\u00a0s`;

// A stability limit, with so many digits that it is not taken for the timestep of the run.
export function limitText({ control, timestep_s: limit }, { controls }) {
  return seconds(limit, seconds(limit) === seconds(controls[control]) ? 6 : 4);
}

function superscript(exponent) {
  return Array.from(exponent.replace("+", ""), (sign) => (sign === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign])).join("");
}
