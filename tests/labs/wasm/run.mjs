// Runs the labs of stdin (JSON) in the official WASM build of MuJoCo, as a page without a server would: every
// expression is JavaScript of its own. Answers with the values of the readouts at the steps that are asked for.
// node run.mjs FOLDER, where FOLDER holds node_modules.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const load = (await import(pathToFileURL(`${process.argv[2]}/node_modules/@mujoco/mujoco/mujoco.js`))).default;
const mujoco = await load();
const NAMES = ["model", "data", "mj", "ctx", "lib", "sim", "value"];

// The eigenvalues of a symmetric matrix, by Jacobi's rotations.
function eigenvalues(matrix) {
  const a = matrix.map((row) => [...row]), n = a.length;
  for (let sweep = 0; sweep < 60; sweep++) {
    for (let p = 0; p < n; p++) for (let q = p + 1; q < n; q++) {
      if (Math.abs(a[p][q]) < 1e-300) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1)), c = 1 / Math.hypot(t, 1), s = t * c;
      for (let k = 0; k < n; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < n; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
    }
  }
  return a.map((row, i) => row[i]);
}

function library(model, data) {
  const id = (kind, name) => mujoco.mj_name2id(model, mujoco.mjtObj[`mjOBJ_${kind}`].value, name);
  const three = (array, index) => Array.from(array.slice(3 * index, 3 * index + 3));
  const rows = (flat, width, count) => Array.from({ length: count }, (_, i) => Array.from(flat.slice(i * width, (i + 1) * width)));
  const buffer = (size) => new mujoco.DoubleBuffer(size);
  const contacts = () => Array.from({ length: data.ncon }, (_, i) => data.contact.get(i));
  const lib = {
    sitePos: (name) => three(data.site_xpos, id("SITE", name)),
    bodyId: (name) => id("BODY", name),
    jointId: (name) => id("JOINT", name),
    qpos: (name) => data.qpos[model.jnt_qposadr[id("JOINT", name)]],
    energy: () => ({ potential: data.energy[0], kinetic: data.energy[1], total: data.energy[0] + data.energy[1] }),
    norm: (array) => Math.hypot(...array),
    contactPairs: () => contacts().map((one) => `${one.geom1} / ${one.geom2}`),
    normalForce: (name) => contacts().reduce((sum, one, i) => {
      if (![one.geom1, one.geom2].includes(id("GEOM", name))) return sum;
      const force = buffer(6);
      mujoco.mj_contactForce(model, data, i, force);
      return sum + force.GetView()[0];
    }, 0),
    massMatrix: () => {
      const full = buffer(model.nv * model.nv);
      mujoco.mj_forward(model, data);
      mujoco.mj_fullM(model, data, full);
      return rows(full.GetView(), model.nv, model.nv);
    },
    jacobian: (name, columns = model.nv) => {
      const [p, r] = [buffer(3 * model.nv), buffer(3 * model.nv)];
      mujoco.mj_jacSite(model, data, p, r, id("SITE", name));
      return [...rows(p.GetView(), model.nv, 3), ...rows(r.GetView(), model.nv, 3)].map((row) => row.slice(0, columns));
    },
    jacobianSV: (name, { cols = model.nv, rows: which = "full" } = {}) => {
      const taken = lib.jacobian(name, cols).slice(0, which === "pos" ? 3 : 6);
      const gram = taken.map((a) => taken.map((b) => a.reduce((sum, x, k) => sum + x * b[k], 0)));
      return eigenvalues(gram).map((x) => Math.sqrt(Math.max(x, 0))).sort((a, b) => b - a);
    },
  };
  return lib;
}

// mj_setConst, but the state stays, as labs here have it.
function keeping(model, data) {
  const kept = ["qpos", "qvel", "ctrl"].map((name) => [name, Array.from(data[name])]);
  mujoco.mj_setConst(model, data);
  for (const [name, values] of kept) data[name].set(values);
}

function run({ xml, config, controls, presses, steps }) {
  const model = mujoco.MjModel.from_xml_string(xml), data = new mujoco.MjData(model), ctx = {};
  const lib = library(model, data), forward = () => mujoco.mj_forward(model, data);
  const sim = { play() {}, pause() {}, forward };
  const mj = new Proxy(mujoco, { get: (all, name) => (name === "mj_setConst" ? keeping : all[name]) });
  const compiled = (body) => {
    const made = new Function(...NAMES, `"use strict"; ${body}`);
    return (value) => made(model, data, mj, ctx, lib, sim, value);
  };
  model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY.value;
  if (config.key !== undefined) {
    const key = typeof config.key === "string" ? mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY.value, config.key) : config.key;
    mujoco.mj_resetDataKeyframe(model, data, key);
  }
  const set = (wanted) => {
    for (const one of (config.controls ?? []).filter((control) => control.type !== "button" && wanted(control))) {
      const body = one.param ? `ctx.${one.param} = value` : one.set ? `${one.set} = value` : one.apply;
      compiled(body)(controls[one.label]);
    }
  };
  set(() => true);
  if (config.setup) compiled(config.setup)();
  set((control) => control.init);
  forward();
  const controller = config.controller ? compiled(config.controller) : () => {};
  const shown = config.readouts.map((one) => compiled(`return (${one.expr});`));
  const pressed = (label) => { compiled(config.controls.find((one) => one.label === label).run)(); forward(); };
  const rows = [];
  let step = 0;
  for (const wanted of steps) {
    for (; step < wanted; step++) {
      controller();
      mujoco.mj_step(model, data);
    }
    for (const [, label] of presses.filter(([at]) => at === step)) pressed(label);
    rows.push(shown.map((one) => one()));
  }
  return rows;
}

process.stdout.write(JSON.stringify(JSON.parse(readFileSync(0, "utf8")).map(run)));
