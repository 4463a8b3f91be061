// Lit solids with soft shadows: one WebGL2 renderer for all scenes of a page, since browsers limit contexts. A scene copies
// the picture into its own canvas, where overlays are drawn over it.

import { cross, dot, plus, unit } from "./geometry.js";
import { reachOf, scaleOf, solidOf } from "./solids.js";
import { FLOOR_PROGRAM, MAP, SOLID_PROGRAM } from "./shaders.js";

const FOV = Math.PI / 4; // MuJoCo's default vertical field of view
const STRIDE = 15; // floats of an instance: place and shift, quaternion, scale, colour
const CORNERS = [[12, 12], [40, 20], [120, 32], [Infinity, 56]]; // around a round solid, up to this radius [px]
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i; // there the painter is several times as fast
const GHOST = 0.36, FADE = 2.4;

const rows = (x, y, z, w) => [0, 1, 2, 3].flatMap((column) => [x[column], y[column], z[column], w[column]]);
const row = (axis, factor, from) => [...axis.map((value) => factor * value), -factor * dot(axis, from)];

let shared;

export class Light {
  // The renderer of the page; null without a GPU. `?scene=light` and `?scene=painted` in the page's address choose.
  static get shared() {
    if (shared === undefined) shared = Light.open(new URLSearchParams(location.search).get("scene"));
    return shared;
  }

  static open(wish) {
    if (wish === "painted") return null;
    const canvas = document.createElement("canvas"), gl = canvas.getContext("webgl2", { antialias: true });
    if (!gl) return null;
    const named = gl.getExtension("WEBGL_debug_renderer_info");
    const isSoftware = SOFTWARE.test(gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    return isSoftware && wish !== "light" ? null : new Light(canvas, gl);
  }

  constructor(canvas, gl) {
    Object.assign(this, { canvas, gl, frames: 0, isLost: false });
    canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.isLost = true; });
    canvas.addEventListener("webglcontextrestored", () => {
      this.isLost = false;
      this.begin();
      dispatchEvent(new Event("resize")); // see watchLooks
    });
    this.begin();
  }

  begin() {
    const { gl } = this;
    this.meshes = new Map();
    [this.solid, this.floor] = [SOLID_PROGRAM, FLOOR_PROGRAM].map((sources) => this.compile(sources));
    this.instances = gl.createBuffer();
    this.nothing = gl.createVertexArray();
    this.map = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, MAP, MAP);
    const settings = { TEXTURE_COMPARE_MODE: "COMPARE_REF_TO_TEXTURE", TEXTURE_MIN_FILTER: "LINEAR", TEXTURE_MAG_FILTER: "LINEAR", TEXTURE_WRAP_S: "CLAMP_TO_EDGE", TEXTURE_WRAP_T: "CLAMP_TO_EDGE" };
    for (const [name, value] of Object.entries(settings)) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl[value]);
    this.depths = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.depths);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.map, 0);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  compile(sources) {
    const { gl } = this, program = gl.createProgram(), places = {};
    sources.forEach((source, index) => {
      const shader = gl.createShader(index ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    });
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(`no program: ${gl.getProgramInfoLog(program)}`);
    for (let i = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) - 1; i >= 0; i--) {
      const { name } = gl.getActiveUniform(program, i);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  use({ program, places }, values) {
    const { gl } = this;
    gl.useProgram(program);
    for (const [name, value] of Object.entries(values)) {
      if (!places[name]) continue;
      if (typeof value === "number") gl.uniform1f(places[name], value);
      else if (value.length === 16) gl.uniformMatrix4fv(places[name], false, value);
      else gl[`uniform${value.length}fv`](places[name], value);
    }
  }

  // The triangles of a geom on the GPU, which are kept.
  mesh(geom, around) {
    const solid = solidOf(geom, around), { rows: points, faces } = solid, { gl } = this;
    if (this.meshes.has(solid)) return this.meshes.get(solid);
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.STATIC_DRAW);
    [[3, 0], [3, 12], [1, 24]].forEach(([size, offset], at) => {
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, gl.FLOAT, false, 28, offset);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(faces), gl.STATIC_DRAW);
    for (const at of [3, 4, 5, 6]) {
      gl.enableVertexAttribArray(at);
      gl.vertexAttribDivisor(at, 1);
    }
    const made = { array, corners: faces.length };
    this.meshes.set(solid, made);
    return made;
  }

  // Writes [geom, pose] pairs as instances from `first` on. What is drawn in one call each: the mesh, from where, how many.
  gather(pairs, data, first, around) {
    const groups = new Map();
    for (const pair of pairs) {
      const mesh = this.mesh(pair[0], around(pair));
      if (!groups.has(mesh)) groups.set(mesh, []);
      groups.get(mesh).push(pair);
    }
    let next = first;
    return Array.from(groups, ([mesh, members]) => {
      const from = next;
      for (const [geom, [x, y, z, ...turn]] of members) {
        const [a, b, c, shift] = scaleOf(geom), [red = 0.5, green = 0.5, blue = 0.5, alpha = 1] = geom.rgba;
        data.set([x, y, z, shift, ...turn, a, b, c, red, green, blue, alpha], STRIDE * next++);
      }
      return { mesh, from, count: members.length };
    });
  }

  drawAll(batches) {
    const { gl } = this;
    for (const { mesh, from, count } of batches) {
      gl.bindVertexArray(mesh.array);
      [[4, 0], [4, 16], [3, 32], [4, 44]].forEach(([size, offset], i) => gl.vertexAttribPointer(3 + i, size, gl.FLOAT, false, 4 * STRIDE, 4 * STRIDE * from + offset));
      gl.drawElementsInstanced(gl.TRIANGLES, mesh.corners, gl.UNSIGNED_INT, 0, count);
    }
  }

  // Depth first, then colour: of what is translucent the nearest surface is seen alone.
  drawThin(batches) {
    const { gl } = this;
    gl.colorMask(false, false, false, false);
    this.drawAll(batches);
    gl.colorMask(true, true, true, true);
    gl.enable(gl.BLEND);
    this.drawAll(batches);
    gl.disable(gl.BLEND);
  }

  // view: as of viewFrom; solids, ghosts, floors: lists of [geom, pose]; around: {middle, radius} of what casts shadows; sun:
  // the direction to it; ink: the colour of the page's text, from 0 to 1. The picture is the lower left part of this.canvas. False where there is none.
  draw({ width, height, view, distance, around, sun, ink, hasShadows, solids, ghosts, floors }) {
    const { gl, canvas } = this;
    if (this.isLost || !width || !height) return false;
    if (canvas.width < width) canvas.width = width;
    if (canvas.height < height) canvas.height = height;
    const { eye, right, above, forward } = view, zoom = Math.min(height, 1.2 * width) / Math.tan(FOV / 2);
    const near = 0.02 * distance, far = 60 * distance, deep = (far + near) / (far - near), depth = row(forward, 1, eye);
    const camera = rows(row(right, zoom / width, eye), row(above, zoom / height, eye), depth.map((value, i) => deep * value - (i === 3 ? (2 * far * near) / (far - near) : 0)), depth);
    const side = unit(cross([0.01, 0.02, 1], sun)), scale = 1 / around.radius;
    const light = rows(row(side, scale, around.middle), row(cross(sun, side), scale, around.middle), row(sun, -scale / 2, around.middle), [0, 0, 0, 1]);
    const detail = ([geom, pose]) => {
      const size = ((zoom / 2) * reachOf(geom)) / Math.hypot(...plus(pose.slice(0, 3), eye, -1));
      return CORNERS.find(([most]) => size < most)[1];
    };
    const isThick = ([geom]) => (geom.rgba[3] ?? 1) >= 1, data = new Float32Array(STRIDE * (solids.length + ghosts.length));
    const some = solids.filter(isThick), thick = this.gather(some, data, 0, detail);
    const thin = this.gather(solids.filter((solid) => !isThick(solid)), data, some.length, detail), pale = this.gather(ghosts, data, solids.length, detail);
    const all = { camera, light, eye, sun, ink, ghost: [0, 0, 0, 0], texel: (2 * around.radius) / MAP, dark: ink[0] > 0.5 ? 1 : 0 };
    gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.disable(gl.BLEND);
    this.drawDepths(hasShadows ? [...thick, ...thin] : [], all);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.use(this.solid, all);
    this.drawAll(thick);
    this.drawFloors(floors, { ...all, fade: [...around.middle, Math.min(Math.max(2.2 * around.radius, 1.6 * distance), FADE * distance)] }, far / 3);
    this.use(this.solid, all);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
    this.drawThin(thin);
    this.use(this.solid, { ghost: [...ink, GHOST] });
    this.drawThin(pale);
    gl.disable(gl.SCISSOR_TEST);
    this.frames += 1;
    return true;
  }

  // What the sun sees: a map of depths, by which the shaders tell what is in shadow.
  drawDepths(batches, all) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.depths);
    gl.bindTexture(gl.TEXTURE_2D, null);
    gl.viewport(0, 0, MAP, MAP);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1.5, 2);
    this.use(this.solid, { ...all, camera: all.light, ghost: [0, 0, 0, 1] });
    this.drawAll(batches);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.bindTexture(gl.TEXTURE_2D, this.map);
  }

  drawFloors(floors, values, endless) {
    const { gl } = this;
    this.use(this.floor, values);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    gl.bindVertexArray(this.nothing);
    for (const [{ size: [a, b], cell, lay }, pose] of floors) {
      this.use(this.floor, { place: [pose[0], pose[1], pose[2], cell], turn: pose.slice(3), extent: [a || endless, b || endless], lay });
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }
}
