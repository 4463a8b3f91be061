// Draws how far the joint still swings, over the damping.

import { drawChart, seriesClass } from "../chart.js";
import { number } from "../dom.js";
import { Newest } from "../newest.js";

export function open(box, page) {
  const picture = box.querySelector(".strips"), inputs = [...box.querySelectorAll("[data-setting]")];
  let answer = null;
  const draw = () => { if (answer) drawChart(picture, chartOf(answer)); };
  const show = (run) => {
    answer = run;
    draw();
    const [first, last] = [run.swings[0], run.swings.at(-1)].map((swing) => (swing === null ? "no number: MuJoCo reset the state" : `${number(swing)} rad`));
    page.tell(`${run.swings.length} runs from ${number(run.angle)} rad: ${first} under the least damping, ${last} under the most.`);
  };
  const ask = () => page.run(Object.fromEntries(inputs.map((input) => [input.dataset.setting, input.valueAsNumber])));
  const runs = new Newest(ask, show, (error) => page.tell(error.message, true));
  for (const input of inputs) {
    input.disabled = false;
    input.addEventListener("change", () => {
      input.setAttribute("aria-invalid", String(!input.checkValidity() || input.value === ""));
      if (inputs.every((one) => one.checkValidity() && one.value !== "")) runs.want({});
      else page.tell(`${box.querySelector(`[for="${input.id}"]`).textContent} must be from ${input.min} to ${input.max}.`, true);
    });
  }
  new ResizeObserver(draw).observe(picture);
  runs.want({});
}

const chartOf = ({ damping, swings }) => ({
  begin: damping[0],
  end: damping.at(-1),
  xlabel: "damping (N m s/rad)",
  strips: [{ label: "widest swing (rad)", weight: 1, axis: { min: 0 }, shows: swings.filter((one) => one !== null), lines: [], ghost: [],
    series: [{ label: "", className: seriesClass(0), times: damping, values: swings }] }],
});
