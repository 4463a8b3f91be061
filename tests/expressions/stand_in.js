// Evaluates the cases of stdin (JSON) in Node, on plain stand-ins for the model and the data.
// The answer carries every number as the hex digits of its 64 bits, so that NaN, -0 and the last bit survive.
'use strict'
const input = JSON.parse(require('fs').readFileSync(0, 'utf8'))
const view = new DataView(new ArrayBuffer(8))
const hex = x => { view.setFloat64(0, x); return view.getBigUint64(0).toString(16).padStart(16, '0') }
const encode = v => {
  if (typeof v === 'number') return { n: hex(v) }
  if (typeof v === 'string') return { s: v }
  if (typeof v === 'boolean') return { b: v }
  if (v === null) return { z: 0 }
  if (v === undefined) return { u: 0 }
  if (Array.isArray(v)) return { a: Array.from(v, encode) }
  if (ArrayBuffer.isView(v)) return { t: Array.from(v, x => hex(x)) }
  return { r: Object.fromEntries(Object.entries(v).map(([k, x]) => [k, encode(x)])) }
}
const TYPES = { f8: Float64Array, f4: Float32Array, i4: Int32Array, b1: Uint8Array, u1: Uint8Array }
const revive = part => Object.fromEntries(Object.entries(part).map(([name, v]) =>
  [name, v.type ? TYPES[v.type].from(v.values) : typeof v === 'object' ? revive(v) : v]))
const library = table => ({
  energy: () => ({ ...table.energy }), com: () => [...table.com],
  bodyPos: n => [...table.bodyPos[n]], sitePos: n => [...table.sitePos[n]], geomPos: n => [...table.geomPos[n]],
  bodyVel: n => [...table.bodyVel[n]], qpos: n => table.qpos[n], qvel: n => table.qvel[n], sensor: n => table.sensor[n],
  normalForce: g => table.normalForce[g ?? ''], contacts: g => table.contacts[g ?? ''],
  bodyId: n => table.bodyId[n], jointId: n => table.jointId[n], massMatrix: () => table.massMatrix.map(row => [...row]),
  jacobian: n => table.jacobian[n].map(row => [...row]), jacobianSV: n => [...table.jacobianSV[n]],
  contactPairs: () => [...table.contactPairs],
  norm: a => Math.hypot(...a), dot: (a, b) => a.reduce((s, x, i) => s + x * b[i], 0),
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  deg: x => x * 180 / Math.PI, rad: x => x * Math.PI / 180, clamp: (x, a, b) => Math.min(Math.max(x, a), b)
})
const mujoco = table => ({
  ...table.enums,
  mj_resetData: (model, data) => { data.qpos.set(model.qpos0); data.qvel.fill(0); data.ctrl.fill(0); data.qacc_warmstart.fill(0); data.time = 0 },
  mj_setConst: () => undefined, mj_forward: () => undefined,
  mj_name2id: (model, kind, name) => table.ids[kind + ' ' + name] ?? -1
})
const evaluate = ({ kind, text, value }) => {
  const model = revive(input.model), data = revive(input.data), ctx = {}
  const body = kind === 'expression' ? `return (${text}\n)` : text
  try {
    const f = new Function('model', 'data', 'mj', 'ctx', 'lib', 'sim', 'value', '"use strict"; ' + body)
    const sim = { play: () => undefined, pause: () => undefined, forward: () => undefined }
    const result = f(model, data, mujoco(input.table), ctx, library(input.table), sim, value)
    if (kind === 'expression') return { value: encode(result) }
    return { value: encode(undefined), model: encode(model), data: encode(data), ctx: encode(ctx) }
  } catch (error) {
    return { error: String(error) }
  }
}
process.stdout.write(JSON.stringify(input.cases.map(evaluate)))
