// The programs of light.js: solids under a sun, a sky and their own shadows; a floor that fades and catches shadows.

export const MAP = 1024; // texels along a side of the shadow map

const SAMPLES = 16, BLUR = 4.5 / MAP; // of a shadow's edge: points of Vogel's spiral, and its radius

const HEAD = `#version 300 es
precision highp float;
precision highp sampler2DShadow;
uniform mat4 camera, light;
uniform vec3 eye, sun, ink;
uniform vec4 ghost;
uniform sampler2DShadow map;
uniform float texel, dark;
`;

const TURNED = `vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
`;

const LIT = `float lit(vec3 at, vec3 normal) {
  vec4 seen = light * vec4(at + normal * texel * 1.5, 1.0);
  if (any(greaterThan(abs(seen.xy), vec2(1.0)))) return 1.0;
  vec3 place = seen.xyz * 0.5 + 0.5;
  float sum = 0.0;
  for (int i = 0; i < ${SAMPLES}; i++) {
    float radius = sqrt((float(i) + 0.5) / ${SAMPLES}.0), angle = float(i) * 2.39996;
    sum += texture(map, vec3(place.xy + radius * vec2(cos(angle), sin(angle)) * ${BLUR.toFixed(6)}, min(place.z, 1.0)));
  }
  return sum / ${SAMPLES}.0;
}
`;

export const SOLID_PROGRAM = [
  `${HEAD}${TURNED}layout(location=0) in vec3 point;
layout(location=1) in vec3 normal;
layout(location=2) in float end;
layout(location=3) in vec4 place;
layout(location=4) in vec4 turn;
layout(location=5) in vec3 scale;
layout(location=6) in vec4 tint;
out vec3 at, outside;
out vec4 colour;
void main() {
  at = place.xyz + turned(turn, point * scale + vec3(0, 0, end * place.w));
  outside = turned(turn, normal / scale);
  colour = tint;
  gl_Position = camera * vec4(at, 1);
}`,
  `${HEAD}${LIT}in vec3 at, outside;
in vec4 colour;
out vec4 seen;
void main() {
  vec3 view = normalize(eye - at), normal = faceforward(normalize(outside), -view, outside);
  float key = max(dot(normal, sun), 0.0), edge = pow(1.0 - abs(dot(normal, view)), 3.0);
  if (ghost.a > 0.0) {
    float alpha = ghost.a * mix(0.45, 1.6, edge);
    seen = vec4(mix(ghost.rgb, colour.rgb, 0.35) * alpha, alpha);
    return;
  }
  float sunny = key > 0.0 ? lit(at, normal) : 0.0;
  vec3 base = pow(colour.rgb, vec3(2.2));
  vec3 sky = mix(vec3(0.62, 0.66, 0.72), vec3(0.36, 0.40, 0.48), dark), ground = mix(vec3(0.30, 0.28, 0.26), vec3(0.10, 0.10, 0.12), dark);
  vec3 around = mix(ground, sky, normal.z * 0.5 + 0.5) * (0.56 + 0.28 * abs(dot(normal, view)));
  vec3 sum = base * (around + vec3(1.0, 0.97, 0.91) * 0.92 * key * sunny);
  sum += (0.22 * pow(max(dot(normal, normalize(view + sun)), 0.0), 60.0) * sunny + edge * mix(0.05, 0.12, dark)) * sky;
  sum = sum * (1.0 + sum * 0.12) / (1.0 + sum * 0.22);
  seen = vec4(pow(sum, vec3(0.4545)), 1.0) * colour.a;
}`,
];

export const FLOOR_PROGRAM = [
  `${HEAD}${TURNED}uniform vec4 place, turn;
uniform vec2 extent;
out vec3 at, local, normal;
void main() {
  local = vec3((vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0) * extent, 0);
  normal = turned(turn, vec3(0, 0, 1));
  at = place.xyz + turned(turn, local);
  gl_Position = camera * vec4(at, 1);
}`,
  `${HEAD}${LIT}uniform vec4 place, fade;
uniform float lay;
in vec3 at, local, normal;
out vec4 seen;
void main() {
  vec2 cell = local.xy / place.w, width = fwidth(cell) + 1e-5, line = abs(fract(cell - 0.5) - 0.5) / width;
  vec2 fields = (abs(fract((cell - 0.5 * width) * 0.5) - 0.5) - abs(fract((cell + 0.5 * width) * 0.5) - 0.5)) * 2.0 / width;
  float check = 0.5 - 0.5 * fields.x * fields.y; // of a chessboard, averaged over the pixel
  float near = 1.0 - smoothstep(0.35, 1.0, length(at - fade.xyz) / fade.w);
  float base = lay * (mix(0.045, 0.10, check) + 0.05 * (1.0 - min(min(line.x, line.y), 1.0))) * near;
  float steep = smoothstep(0.08, 0.3, abs(dot(normalize(eye - at), normal)));
  float shade = (1.0 - lit(at, vec3(0))) * mix(0.27, 0.55, dark) * near * steep;
  seen = vec4(ink * base * (1.0 - shade), base + shade * (1.0 - base));
}`,
];
