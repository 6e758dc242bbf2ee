"use strict";
// A small WebGL viewer: a translucent surface with its kernel inside; no library.
window.makeViewer = (canvas) => {
const gl = canvas.getContext("webgl", { antialias: true, alpha: true });
if (!gl) return null;
const VERTEX = `attribute vec3 at; attribute vec3 normal; uniform mat3 turn; uniform vec3 middle; uniform float scale, near, aspect, size;
varying vec3 n; varying vec3 p;
void main() { p = turn * (at - middle) * scale; n = turn * normal; float d = near - p.z;
  gl_Position = vec4(p.x * 3.1 / max(aspect, 1.0), p.y * 3.1 * min(aspect, 1.0), d * 1.001 - 0.1, d); gl_PointSize = size; }`;
const FRAGMENT = `precision mediump float; uniform vec4 color; uniform float glass, dot_; varying vec3 n; varying vec3 p;
void main() {
  if (dot_ > 0.5) { float r = length(gl_PointCoord - 0.5); if (r > 0.5) discard; gl_FragColor = r > 0.34 ? vec4(1.0) : vec4(color.rgb, 1.0); return; }
  vec3 m = normalize(n + vec3(0.0, 0.0, 1e-6)); float facing = abs(m.z);
  float light = 0.56 + 0.36 * abs(dot(m, normalize(vec3(0.35, 0.6, 0.72)))) + 0.12 * facing;
  if (glass > 0.5) light = mix(light, 1.0, 0.55);
  float alpha = glass > 0.5 ? min(color.a * mix(2.1, 0.7, facing), 1.0) : 1.0;
  gl_FragColor = vec4(color.rgb * light * alpha, alpha); }`;
function shader(kind, source) { const s = gl.createShader(kind); gl.shaderSource(s, source); gl.compileShader(s); gl.attachShader(program, s); }
const program = gl.createProgram();
shader(gl.VERTEX_SHADER, VERTEX); shader(gl.FRAGMENT_SHADER, FRAGMENT); gl.linkProgram(program);
if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
gl.useProgram(program);
const uniform = (name) => gl.getUniformLocation(program, name), AT = gl.getAttribLocation(program, "at"), NORMAL = gl.getAttribLocation(program, "normal");
const U = Object.fromEntries(["turn", "middle", "scale", "near", "aspect", "size", "color", "glass", "dot_"].map((k) => [k, uniform(k)]));

function bytes(text) { const raw = atob(text), out = new Uint8Array(raw.length); for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i); return out.buffer; }
function box(points) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i++) { const k = i % 3; if (points[i] < low[k]) low[k] = points[i]; if (points[i] > high[k]) high[k] = points[i]; }
  return { middle: low.map((v, k) => (v + high[k]) / 2), radius: Math.hypot(...low.map((v, k) => high[k] - v)) / 2 };
}
// Positions are taken relative to the surface's middle, in double precision, so that far-away meshes stay sharp.
function part(points, faces, origin) {
  const corners = new Float32Array(faces.length * 6);
  const p = (i, k) => points[3 * i + k] - origin[k];
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [faces[f], faces[f + 1], faces[f + 2]];
    const u = [0, 1, 2].map((k) => p(b, k) - p(a, k)), v = [0, 1, 2].map((k) => p(c, k) - p(a, k));
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], length = Math.hypot(...n) || 1;
    [a, b, c].forEach((i, j) => { for (let k = 0; k < 3; k++) { corners[(f + j) * 6 + k] = p(i, k); corners[(f + j) * 6 + 3 + k] = n[k] / length; } });
  }
  return buffer(corners);
}
function buffer(corners) { const b = gl.createBuffer(); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW); return { b, n: corners.length / 6 }; }
// Edges where the surface bends sharply or ends, drawn as lines.
function creases(points, faces, origin) {
  const seen = new Map(), ends = [];
  if (faces.length > 600000) return null;
  for (let f = 0; f < faces.length; f += 3) {
    const p = (j, k) => points[3 * faces[f + j] + k] - origin[k];
    const u = [0, 1, 2].map((k) => p(1, k) - p(0, k)), v = [0, 1, 2].map((k) => p(2, k) - p(0, k));
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], length = Math.hypot(...n) || 1;
    for (let j = 0; j < 3; j++) {
      const a = faces[f + j], b = faces[f + (j + 1) % 3], key = Math.min(a, b) * 4194304 + Math.max(a, b), other = seen.get(key);
      if (!other) seen.set(key, [a, b, ...n.map((x) => x / length)]);
      else { seen.delete(key); if (other[2] * n[0] + other[3] * n[1] + other[4] * n[2] < 0.82 * length) ends.push(a, b); }
    }
  }
  for (const [a, b] of seen.values()) ends.push(a, b);
  const at = new Float32Array(ends.length * 3);
  ends.forEach((i, j) => { for (let k = 0; k < 3; k++) at[3 * j + k] = points[3 * i + k]; });
  return loose(at, origin);
}
function loose(points, origin) { const out = new Float32Array(points.length * 2); for (let i = 0; i < points.length / 3; i++) for (let k = 0; k < 3; k++) out[6 * i + k] = points[3 * i + k] - origin[k]; return buffer(out); }

const START = (() => { const a = 0.5, b = -0.42; // seen from above and the side
  return [Math.cos(a), Math.sin(b) * Math.sin(a) * -1, Math.cos(b) * -Math.sin(a), 0, Math.cos(b), Math.sin(b), Math.sin(a), -Math.sin(b) * Math.cos(a), Math.cos(b) * Math.cos(a)]; })();
let scene = null, turn = START.slice(), zoom = 1, focus = null, alpha = 0.34, asked = false;
const NEAR = 3.4;
function multiply(a, b) { // column-major 3 x 3
  const out = new Array(9); for (let c = 0; c < 3; c++) for (let r = 0; r < 3; r++) out[3 * c + r] = a[r] * b[3 * c] + a[3 + r] * b[3 * c + 1] + a[6 + r] * b[3 * c + 2]; return out;
}
function rotate(x, y) { const [s, c] = [Math.sin(x), Math.cos(x)], [t, d] = [Math.sin(y), Math.cos(y)];
  turn = multiply(multiply([1, 0, 0, 0, d, t, 0, -t, d], [c, 0, -s, 0, 1, 0, s, 0, c]), turn); ask(); }
function shade() { const css = getComputedStyle(document.documentElement); const rgb = (name) => { const h = css.getPropertyValue(name).trim(); return [1, 3, 5].map((i) => parseInt(h.slice(i, i + 2), 16) / 255); };
  return { surface: rgb("--glass"), ink: rgb("--ink"), kernel: rgb(scene && scene.relaxed ? "--relaxed" : "--kernel"), center: rgb("--not") }; }
function pass(item, mode, color, glass) {
  if (!item || !item.n) return;
  gl.bindBuffer(gl.ARRAY_BUFFER, item.b);
  gl.enableVertexAttribArray(AT); gl.vertexAttribPointer(AT, 3, gl.FLOAT, false, 24, 0);
  gl.enableVertexAttribArray(NORMAL); gl.vertexAttribPointer(NORMAL, 3, gl.FLOAT, false, 24, 12);
  gl.uniform4fv(U.color, color); gl.uniform1f(U.glass, glass ? 1 : 0); gl.uniform1f(U.dot_, mode === gl.POINTS ? 1 : 0);
  gl.drawArrays(mode, 0, item.n);
}
function draw() {
  asked = false;
  if (!scene) return;
  const ratio = Math.min(devicePixelRatio || 1, 2), w = Math.max(1, Math.round(canvas.clientWidth * ratio)), h = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  gl.viewport(0, 0, w, h); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const near = focus ? scene.kernel : scene.whole, colors = shade();
  gl.uniformMatrix3fv(U.turn, false, turn); gl.uniform3fv(U.middle, near.middle); gl.uniform1f(U.scale, zoom / near.radius);
  gl.uniform1f(U.near, NEAR); gl.uniform1f(U.aspect, w / h); gl.uniform1f(U.size, 13 * ratio);
  gl.enable(gl.DEPTH_TEST); gl.disable(gl.BLEND); gl.disable(gl.CULL_FACE); gl.depthMask(true);
  pass(scene.solid, gl.TRIANGLES, [...colors.kernel, 1], false);
  pass(scene.segment, gl.LINES, [...colors.kernel, 1], false);
  gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA); gl.depthMask(false);
  gl.enable(gl.CULL_FACE);
  for (const side of [gl.FRONT, gl.BACK]) { gl.cullFace(side); pass(scene.surface, gl.TRIANGLES, [...colors.surface, alpha], true); }
  gl.disable(gl.CULL_FACE);
  pass(scene.creases, gl.LINES, [...colors.ink, 0.3 + 0.5 * alpha], true);
  gl.disable(gl.DEPTH_TEST);
  pass(scene.point, gl.POINTS, [...colors.kernel, 1], false);
  pass(scene.center, gl.POINTS, [...(scene.kernel ? colors.kernel : colors.center), 1], false);
}
function ask() { if (!asked) { asked = true; requestAnimationFrame(draw); } }

// ---------------------------------------------------------------- mouse, touch, keys
const fingers = new Map();
canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, [e.clientX, e.clientY]); });
for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (e) => fingers.delete(e.pointerId));
canvas.addEventListener("pointermove", (e) => {
  const was = fingers.get(e.pointerId); if (!was) return;
  const apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
  const before = fingers.size === 2 ? apart() : 0;
  fingers.set(e.pointerId, [e.clientX, e.clientY]);
  if (fingers.size === 2) closer(apart() / (before || 1)); else rotate((e.clientX - was[0]) * 0.009, (e.clientY - was[1]) * 0.009);
});
function closer(by) { zoom = Math.min(40, Math.max(0.2, zoom * by)); ask(); }
canvas.addEventListener("wheel", (e) => { e.preventDefault(); closer(Math.exp(-e.deltaY * 0.0012)); }, { passive: false });
canvas.addEventListener("keydown", (e) => {
  const steps = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] };
  if (steps[e.key]) rotate(...steps[e.key]); else if (e.key === "+" || e.key === "=") closer(1.15); else if (e.key === "-") closer(1 / 1.15); else return;
  e.preventDefault();
});
new ResizeObserver(ask).observe(canvas);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", ask);

return {
  show(view, center, relaxed) {
    for (const item of scene ? Object.values(scene) : []) if (item && item.b) gl.deleteBuffer(item.b);
    const points = new Float32Array(bytes(view.vertices)), faces = new Uint32Array(bytes(view.faces));
    const own = new Float32Array(bytes(view.kernel_vertices)), ownFaces = new Uint32Array(bytes(view.kernel_faces));
    const all = box(points), origin = all.middle, zero = [0, 0, 0], few = own.length && !ownFaces.length;
    const inner = own.length ? box(own) : null;
    let radius = all.radius || 1; // the kernel of an open surface can be outside
    for (let i = 0; i < own.length; i += 3) radius = Math.max(radius, Math.hypot(own[i] - origin[0], own[i + 1] - origin[1], own[i + 2] - origin[2]));
    scene = { relaxed,
      surface: part(points, faces, origin), creases: creases(points, faces, origin), solid: ownFaces.length ? part(own, ownFaces, origin) : null,
      segment: few && own.length === 6 ? loose(own, origin) : null, point: few ? loose(own, origin) : null,
      center: center ? loose(center, origin) : null, whole: { middle: zero, radius },
      kernel: inner && { middle: inner.middle.map((v, k) => v - origin[k]), radius: 2.2 * Math.max(inner.radius, all.radius * 1e-6) },
    };
    this.reset();
    return Boolean(inner);
  },
  reset() { turn = START.slice(); zoom = 1; focus = false; ask(); },
  closeUp(on) { focus = on && Boolean(scene && scene.kernel); zoom = 1; ask(); },
  opacity(value) { alpha = value; ask(); },
};
};
