"use strict";
(() => {
const byId = (id) => document.getElementById(id);
const data = JSON.parse(byId("rows").textContent);
const wide = data.columns.filter((c) => c.width);
let shown = [];
const column = Object.fromEntries(data.columns.map((c) => [c.key, c]));
const ROW = 53, SPARE = 8;
const CSS = { "star-shaped": "star", degenerate: "flat", "not star-shaped": "not", failed: "failed" };
const has = { view: new Set(data.views), picture: new Set(data.pictures) };
let pictures = null, order = [], sortKey = "", rising = true;

// ---------------------------------------------------------------- values
function value(c, i) { const v = c.values[i]; return c.words ? c.words[v] : v; }
// The number that filters and sorting go by: "never" is more than any.
function amount(c, i) { const v = value(c, i); return c.zero && v === 0 ? Infinity : v; }
function text(c, i) {
  const v = value(c, i);
  if (v === null || v === undefined || v === "") return c.kind === "text" ? "" : "–";
  if (c.kind === "truth") return v ? "yes" : "no";
  if (c.zero && v === 0) return c.zero;
  if (c.kind === "number" && Math.abs(v) !== 1 && Math.abs(+v.toPrecision(4)) === 1) return (v < +v.toPrecision(4) ? "< " : "> ") + +v.toPrecision(4);
  if (c.kind === "number") return Number.isInteger(v) ? v.toLocaleString("en-US") : Math.abs(v) < 1e-3 ? v.toExponential(2) : String(+v.toPrecision(4));
  return String(v);
}
function part(i) {
  for (const key of ["cell", "object"]) {
    const number = column[key] && value(column[key], i);
    if (number !== null && number !== undefined) return " " + key + " " + number;
  }
  return "";
}
function rowName(i) { return value(column.file, i) + part(i); }
function shortName(i) { const name = rowName(i); return name.startsWith(data.folder) ? name.slice(data.folder.length) : name; }
function picture(i) {
  if (!has.picture.has(i)) return null;
  pictures ??= JSON.parse(byId("pictures").textContent);
  const img = document.createElement("img");
  img.decoding = "async"; img.alt = ""; img.src = pictures[i];
  return img;
}
function element(tag, css, words) {
  const e = document.createElement(tag);
  if (css) e.className = css;
  if (words !== undefined) e.textContent = words;
  return e;
}

// ---------------------------------------------------------------- table: only the rows in sight are elements
const frame = byId("frame"), body = byId("body"), above = element("tr", "pad"), below = element("tr", "pad");
const alive = new Map();
const extra = (data.pictures.length ? 1 : 0) + 1;
for (const pad of [above, below]) {
  pad.setAttribute("aria-hidden", "true");
  pad.append(element("td"));
}
body.append(above, below);
function heading(words, width) { const th = element("th"); th.scope = "col"; th.style.width = width; if (words) th.append(element("span", "", words)); return th; }
const head = byId("head");
const empty = (v) => v === null || v === undefined || v === "";
const columnsOf = {};
// Columns that rows of this kind have: those of surfaces are not empty columns of cells.
function useColumns(kind) {
  columnsOf[kind] ??= wide.filter((c) => !kind || c.key === "file" || data.kinds.some((k, i) => k === kind && !empty(value(c, i))));
  const own = columnsOf[kind];
  if (shown === own) return;
  shown = own;
  for (const tr of alive.values()) tr.remove();
  alive.clear();
  for (const pad of [above, below]) pad.firstChild.colSpan = shown.length + extra;
  head.replaceChildren();
  if (data.pictures.length) head.append(heading("Shape", "84px"));
  for (const c of shown) {
    const th = heading("", c.width), button = element("button", "", c.title);
    button.type = "button"; button.title = c.hint || "";
    if (c.kind === "number") th.className = "n";
    th.dataset.key = c.key; th.setAttribute("aria-sort", "none"); th.append(button); head.append(th);
    button.addEventListener("click", () => { rising = sortKey === c.key ? !rising : c.kind === "text"; sortKey = c.key; update(); });
  }
  head.append(heading("Look", "104px"));
  const hidden = wide.filter((c) => !shown.includes(c)).reduce((sum, c) => sum + (parseInt(c.width) || 0), 0);
  byId("table").style.setProperty("--wide", data.wide - hidden + "px");
}

function makeRow(i, place) {
  const tr = element("tr"); tr.dataset.row = i;
  if (data.pictures.length) { const td = element("td"), img = picture(i); if (img) td.append(img); tr.append(td); }
  for (const c of shown) {
    const td = element("td", c.kind === "number" ? "n" : ""), words = text(c, i);
    const div = element("div", c.key === "file" ? "name" : c.key === "outcome" ? CSS[words] : "");
    if (c.key === "outcome") {
      const why = words === "failed" && column.reason ? value(column.reason, i) : "";
      div.append(element("span", "dot"), why ? words + ": " + why : words);
      if (why) td.title = why;
    }
    else div.textContent = c.key === "file" ? shortName(i) : words;
    if (words.length > 22) td.title = words;
    td.append(div); tr.append(td);
  }
  const td = element("td"), button = element("button", "btn tiny", has.view.has(i) ? "3D view" : "Details");
  button.type = "button"; button.setAttribute("aria-label", button.textContent + " of " + rowName(i));
  button.addEventListener("click", () => open(i));
  td.append(button); tr.append(td);
  return tr;
}
function draw(all) {
  const height = frame.clientHeight || 600;
  const first = all ? 0 : Math.max(0, Math.min(order.length, Math.floor(frame.scrollTop / ROW)) - SPARE);
  const last = all ? Math.min(order.length, all) : Math.min(order.length, Math.ceil((frame.scrollTop + height) / ROW) + SPARE);
  const wanted = new Set(order.slice(first, last));
  for (const [i, tr] of alive) if (!wanted.has(i)) { tr.remove(); alive.delete(i); }
  let previous = above;
  for (let k = first; k < last; k++) {
    const i = order[k];
    let tr = alive.get(i);
    if (!tr) { tr = makeRow(i); alive.set(i, tr); }
    tr.setAttribute("aria-rowindex", k + 2);
    if (previous.nextSibling !== tr) previous.after(tr);
    previous = tr;
  }
  above.firstChild.style.height = first * ROW + "px";
  below.firstChild.style.height = (all ? 0 : (order.length - last) * ROW) + "px";
}
let waiting = false;
function later() { if (!waiting) { waiting = true; requestAnimationFrame(() => { waiting = false; draw(); }); } }
frame.addEventListener("scroll", later, { passive: true });
new ResizeObserver(later).observe(frame);
addEventListener("beforeprint", () => draw(200));
addEventListener("afterprint", () => draw());
byId("print-all").addEventListener("change", (e) => { document.documentElement.dataset.print = e.target.checked ? "all" : "one"; });

// ---------------------------------------------------------------- filter and sort
const search = byId("search"), outcome = byId("outcome"), label = byId("label"), sort = byId("kind");
const oneWord = (words) => words.replace(/\b(object|cell)\s+(\d+)/gi, "$1_$2."); // "object 2" is neither 21 nor a 2 elsewhere
sort.closest("label").hidden = !data.kinds.length;
// Several kinds are not listed together: surfaces come first, the others on request.
if (data.kinds.includes("surface")) sort.value = "surface";
const OTHER = { defect: "violation_upper", visible: "visible_fraction", verdict: "outcome", seen: "voxels_seen", iou: "overlap" };
// A number that no object has is taken for the beginning of one.
function known(word) { return /^(object|cell)_\d+\.$/.test(word) && !haystack.some((h) => h.includes(word)) ? word.slice(0, -1) : word; }
const simple = (s) => s.toLowerCase().replace(/[^a-z0-9]/g, "");
function comparison(word) {
  const m = /^([a-z][a-z0-9_.]*)(<=|>=|<|>|=)([-+]?[0-9.]+(?:e[-+]?[0-9]+)?)$/i.exec(word);
  if (!m || Number.isNaN(Number(m[3]))) return null;
  const name = m[1].toLowerCase(), limit = Number(m[3]);
  const c = column[OTHER[name] || name] || data.columns.find((d) => simple(d.title) === simple(name));
  if (!c || c.kind !== "number") return { unknown: m[1] };
  const ok = { "<": (v) => v < limit, ">": (v) => v > limit, "<=": (v) => v <= limit, ">=": (v) => v >= limit, "=": (v) => v === limit }[m[2]];
  return { test: (i) => { const v = amount(c, i); return v !== null && v !== undefined && ok(v); } };
}
const haystack = new Array(data.n);
for (let i = 0; i < data.n; i++) haystack[i] = ["file", "label", "reason", "shortfall", "shortfall_detail", "verdict_reason", "notes", "class", "before"].map((k) => column[k] ? value(column[k], i) : "").concat(oneWord(part(i))).join(" ").toLowerCase();
for (const name of data.labels) { const o = element("option", "", name || "(none)"); o.value = name; label.append(o); }
label.closest("label").hidden = data.labels.length < 2;
const collator = new Intl.Collator("en", { numeric: true });
function compare(c) {
  const sign = rising ? 1 : -1;
  return (a, b) => {
    const x = amount(c, a), y = amount(c, b), noX = x === null || x === "" || x === undefined, noY = y === null || y === "" || y === undefined;
    if (noX || noY) return noX - noY || a - b;
    return sign * (c.kind === "text" ? collator.compare(x, y) : x - y) || a - b;
  };
}
function update() {
  const words = oneWord(search.value.trim()).replace(/\s*(<=|>=|<|>|=)\s*(?=[-+.0-9])/g, "$1").split(/\s+/).filter(Boolean);
  const kind = outcome.value, own = label.selectedIndex > 0 ? label.value : null, tests = words.map(comparison);
  const wanted = words.filter((_, k) => !tests[k]).map((w) => known(w.toLowerCase())), compared = tests.filter((t) => t && t.test);
  const unknown = tests.filter((t) => t && t.unknown).map((t) => t.unknown);
  useColumns(data.kinds.length ? sort.value : "");
  order = [];
  for (let i = 0; i < data.n; i++) {
    if (kind && value(column.outcome, i) !== kind) continue;
    if (sort.value && data.kinds.length && data.kinds[i] !== sort.value) continue;
    if (!compared.every((t) => t.test(i))) continue;
    if (own !== null && value(column.label, i) !== own) continue;
    if (wanted.every((w) => haystack[i].includes(w))) order.push(i);
  }
  if (sortKey) order.sort(compare(column[sortKey]));
  for (const th of head.children) if (th.dataset.key) th.setAttribute("aria-sort", th.dataset.key !== sortKey ? "none" : rising ? "ascending" : "descending");
  byId("table").setAttribute("aria-rowcount", order.length + 1);
  byId("count").textContent = order.length.toLocaleString("en-US") + " of " + data.n.toLocaleString("en-US") + " rows" + (unknown.length ? "; no column of numbers is called " + unknown.join(", ") : "");
  frame.scrollTop = 0;
  draw();
}
search.addEventListener("input", update); outcome.addEventListener("change", update); label.addEventListener("change", update); sort.addEventListener("change", update);
for (const button of document.querySelectorAll("[data-cells]")) button.addEventListener("click", () => {
  search.value = button.dataset.cells; sort.value = "cell"; outcome.value = ""; update(); byId("all").scrollIntoView();
});
byId("clear").addEventListener("click", () => { search.value = ""; sort.value = ""; outcome.value = ""; label.selectedIndex = 0; sortKey = ""; update(); });
for (const tile of document.querySelectorAll(".tile")) tile.addEventListener("click", () => {
  outcome.value = tile.dataset.outcome; update(); byId("all").scrollIntoView(); outcome.focus({ preventScroll: true });
});
byId("csv").addEventListener("click", () => {
  // A cell that a spreadsheet would run as a formula gets an apostrophe in front.
  const quote = (s) => { const t = /^'*[=+\-@\t\r\n\0＝＋－＠]/.test(s) && Number.isNaN(Number(s)) ? "'" + s : s; return /[",\n\r]/.test(t) ? '"' + t.replaceAll('"', '""') + '"' : t; };
  const raw = (c, i) => { const v = value(c, i); return v === null || v === undefined ? "" : quote(String(v)); };
  const lines = [data.columns.map((c) => c.key).join(","), ...order.map((i) => data.columns.map((c) => raw(c, i)).join(","))];
  const link = element("a"); link.href = URL.createObjectURL(new Blob([lines.join("\n") + "\n"], { type: "text/csv" }));
  link.download = "rows.csv"; link.click(); setTimeout(() => URL.revokeObjectURL(link.href), 10000);
});

// ---------------------------------------------------------------- one shape
const dialog = byId("shape"), canvas = byId("canvas"), opacity = byId("opacity"), toKernel = byId("to-kernel");
let viewer = null, current = -1;
function open(i) {
  current = i;
  byId("shape-name").textContent = rowName(i); byId("shape-name").title = rowName(i);
  const facts = byId("facts"); facts.textContent = "";
  for (const c of data.columns) {
    const words = text(c, i);
    if (words === "" || words === "–" || /_[yz]$/.test(c.key)) continue;
    if (c.key.endsWith("_x")) {
      const all = ["_x", "_y", "_z"].map((end) => column[c.key.slice(0, -2) + end]).filter(Boolean);
      facts.append(element("dt", "", c.title), element("dd", "", all.map((own) => text(own, i)).join(", ")));
      continue;
    }
    const dd = element("dd", c.key === "outcome" ? CSS[words] : "");
    if (c.key === "outcome") dd.append(element("span", "dot"), words); else dd.textContent = words;
    facts.append(element("dt", "", c.title), dd);
  }
  const still = byId("still"); still.textContent = "";
  const turning = has.view.has(i);
  byId("turn").hidden = !turning;
  if (!dialog.open) dialog.showModal();
  if (turning) show(i); else { const img = picture(i); still.append(img || element("p", "pale", "No picture of this shape is in the report.")); }
  const at = order.indexOf(i);
  byId("previous").disabled = at <= 0; byId("next").disabled = at < 0 || at + 1 >= order.length;
}
function show(i) {
  viewer ??= window.makeViewer(canvas);
  if (!viewer) { byId("turn").hidden = true; byId("still").append(element("p", "pale", "This browser cannot draw in 3D (no WebGL)."), picture(i) || ""); return; }
  const point = (keys) => { const p = keys.map((k) => column[k] ? value(column[k], i) : null); return p.some((x) => x === null || x === undefined) ? null : p; };
  toKernel.setAttribute("aria-pressed", "false");
  const center = point(["center_x", "center_y", "center_z"]) || point(["star_center_x", "star_center_y", "star_center_z"]);
  const relaxed = Boolean(column.violation_upper && value(column.violation_upper, i) > 0);
  const kernel = viewer.show(JSON.parse(byId("view-" + i).textContent), center, relaxed);
  byId("relaxed").hidden = !kernel || !relaxed;
  toKernel.disabled = !kernel; toKernel.title = kernel ? "" : "The kernel is empty";
  canvas.setAttribute("aria-label", "3D view of " + rowName(i) + ": drag or use the arrow keys to turn, + and - to come closer");
  opacity.dispatchEvent(new Event("input"));
  canvas.focus();
}
byId("previous").addEventListener("click", () => open(order[order.indexOf(current) - 1]));
byId("next").addEventListener("click", () => open(order[order.indexOf(current) + 1]));
byId("close").addEventListener("click", () => dialog.close());
dialog.addEventListener("click", (e) => { if (e.target === dialog) dialog.close(); });
opacity.addEventListener("input", () => viewer && viewer.opacity(+opacity.value));
byId("reset").addEventListener("click", () => { toKernel.setAttribute("aria-pressed", "false"); viewer.reset(); });
toKernel.addEventListener("click", () => { const on = toKernel.getAttribute("aria-pressed") !== "true"; toKernel.setAttribute("aria-pressed", on); viewer.closeUp(on); });
for (const button of document.querySelectorAll("[data-open]")) {
  const i = +button.dataset.open, img = picture(i);
  if (img) button.querySelector(".pic").append(img);
  button.addEventListener("click", () => open(i));
}
update();
document.documentElement.dataset.ready = "yes";
})();
