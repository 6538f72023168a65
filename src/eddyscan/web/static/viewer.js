// The picture of the part: surface, views, path, readings, probe, crop box; turn it, pick in it.

import { Camera } from "./camera.js";
import { colours, gradient } from "./colours.js";
import { CropBox } from "./crop.js";
import { h } from "./dom.js";
import { Painter } from "./gl.js";

const GREY = [176, 186, 196];

export class Viewer {
  constructor(caption = "") {
    this.camera = new Camera();
    this.layers = {};
    this.hidden = new Set();
    this.onPick = () => {};
    this.onTurn = () => {};
    this.canvas = h("canvas", { tabindex: "0", role: "img", "aria-label": "3-D picture of the part; arrow keys turn it" });
    this.tools = h("div", { class: "tools" });
    this.looks = h("div", { class: "looks" });
    this.hint = h("div", { class: "hint" }, "drag: turn · right button or two fingers: shift · wheel: nearer");
    this.legendPlace = h("div", { class: "legend", hidden: true });
    this.nothing = h("div", { class: "nothing" });
    this.element = h("div", { class: "viewer" }, this.canvas, h("div", { class: "caption" }, caption), this.tools, this.looks, this.hint, this.legendPlace, this.nothing);
    try {
      this.painter = new Painter(this.canvas);
    } catch (fault) {
      this.nothing.append(h("div", { class: "card" }, h("h3", {}, "No 3-D picture"), h("p", {}, `${fault.message}. Everything else on this page works; switch on hardware acceleration for the picture.`)));
    }
    this.crop = new CropBox(this);
    this.listen();
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
  }

  // ---- what is shown ----

  set(name, layer) {
    if (this.layers[name] && this.painter) this.painter.drop(this.layers[name].thing);
    if (layer) this.layers[name] = layer;
    else delete this.layers[name];
    this.redraw();
  }

  has(name) {
    return name in this.layers;
  }

  show(names) {
    this.hidden = new Set(Object.keys(this.layers).filter((name) => !names.includes(name)));
    this.redraw();
  }

  setSurface({ vertices, normals, faces }, name = "surface") {
    if (!this.painter) return;
    const plain = new Uint8Array(vertices.length).map((_, k) => GREY[k % 3]);
    this.set(name, { kind: "mesh", thing: this.painter.makeMesh(vertices, normals, faces, plain), vertices, plain });
    this.bounds = boundsOf(vertices);
    this.firstFit();
  }

  paintSurface(values, low, high, map) {
    const layer = this.layers.surface;
    if (!layer || !this.painter) return;
    this.painter.recolour(layer.thing, values ? colours(values, low, high, map, GREY) : layer.plain);
    this.redraw();
  }

  setPoints(name, positions, paint, options = {}) {
    if (!this.painter) return;
    const rgb = paint instanceof Uint8Array ? paint : repeated(paint, positions.length / 3);
    this.set(name, { kind: "points", thing: this.painter.makePoints(positions, rgb), px: 4, ...options });
    if (!this.bounds && positions.length) {
      this.bounds = boundsOf(positions);
      this.firstFit();
    }
  }

  setPath(name, positions, rgb, options = {}) {
    if (!this.painter) return;
    const n = Math.max(0, positions.length / 3 - 1);
    const at = new Float32Array(6 * n);
    const paint = new Uint8Array(6 * n);
    for (let k = 0; k < n; k++) {
      at.set(positions.subarray(3 * k, 3 * k + 6), 6 * k);
      paint.set(rgb.subarray(3 * k, 3 * k + 6), 6 * k);
    }
    this.set(name, { kind: "lines", thing: this.painter.makeLines(at, paint), px: 2.5, ...options });
  }

  setSegments(name, positions, paint, options = {}) {
    if (!this.painter) return;
    const rgb = paint instanceof Uint8Array ? paint : repeated(paint, positions.length / 3);
    this.set(name, { kind: "lines", thing: this.painter.makeLines(positions, rgb), px: 2, ...options });
  }

  // The probe as a pencil: its coil face at `at`, its body along -axis.
  setProbe(at, axis, rgb = [209, 0, 108]) {
    if (!this.painter || !at) {
      this.set("probe", null);
      this.set("probe tip", null);
      return;
    }
    const end = at.map((value, k) => value - 32 * axis[k]);
    this.setSegments("probe", new Float32Array([...at, ...end]), rgb, { px: 5, lift: 0.004 });
    this.setPoints("probe tip", new Float32Array(at), rgb, { px: 15, lift: 0.006 });
  }

  legend(facts) {
    this.legendPlace.hidden = !facts;
    if (!facts) return;
    const bar = h("div", { class: "bar" });
    bar.style.background = gradient(facts.map);
    this.legendPlace.replaceChildren(
      h("div", {}, facts.title),
      bar,
      h("div", { class: "ends" }, h("span", {}, facts.low), h("span", {}, facts.high)),
    );
  }

  say(element) {
    this.nothing.replaceChildren(...(element ? [element] : []));
  }

  // ---- drawing ----

  firstFit() {
    if (this.fitted) return;
    this.fitted = true;
    this.fit();
  }

  fit() {
    if (this.bounds) this.camera.fit(this.bounds);
    this.redraw();
    this.onTurn();
  }

  redraw() {
    if (this.due || !this.painter) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      this.draw();
    });
  }

  draw() {
    const style = getComputedStyle(this.canvas.closest("#picture") || document.body).backgroundColor;
    const background = (style.match(/[\d.]+/g) || [20, 20, 20]).slice(0, 3).map((v) => v / 255);
    this.painter.begin(background);
    const mvp = this.camera.matrix(this.canvas.width / this.canvas.height);
    const { back, up } = this.camera.axes();
    const light = back.map((value, k) => 0.82 * value + 0.57 * up[k]);
    for (const order of ["mesh", "lines", "points"]) {
      for (const [name, layer] of Object.entries(this.layers)) {
        if (layer.kind !== order || this.hidden.has(name)) continue;
        if (order === "mesh") this.painter.drawMesh(layer.thing, mvp, light);
        else if (order === "lines") this.painter.drawLines(layer.thing, mvp, layer);
        else this.painter.drawPoints(layer.thing, mvp, { ...layer, mmScale: this.camera.focal / 2 });
      }
    }
    this.crop.draw(this.painter, mvp);
  }

  // ---- hands ----

  listen() {
    const canvas = this.canvas;
    const fingers = new Map();
    let moved = 0;
    let mode = "";
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
      moved = 0;
      mode = fingers.size > 1 || event.button === 2 || event.shiftKey ? "shift" : "turn";
      if (fingers.size === 1 && this.crop.take(event.offsetX, event.offsetY)) mode = "crop";
      canvas.classList.add("grab");
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const [dx, dy] = [event.offsetX - last[0], event.offsetY - last[1]];
      const gap = spanOf(fingers);
      fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
      moved += Math.abs(dx) + Math.abs(dy);
      if (mode === "crop") this.crop.drag(dx, dy);
      else if (mode === "shift") this.camera.shift(dx, dy, canvas.clientHeight);
      else this.camera.turn(dx, dy);
      if (gap && spanOf(fingers)) this.camera.zoom(gap / spanOf(fingers));
      this.redraw();
      this.onTurn();
    });
    const lift = (event) => {
      if (!fingers.delete(event.pointerId)) return;
      canvas.classList.remove("grab");
      if (mode === "crop") this.crop.release();
      else if (moved < 5 && event.type === "pointerup") this.onPick(event.offsetX, event.offsetY);
    };
    canvas.addEventListener("pointerup", lift);
    canvas.addEventListener("pointercancel", lift);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.camera.zoom(Math.exp(event.deltaY * 0.001));
      this.redraw();
      this.onTurn();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const turns = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, 12], ArrowDown: [0, -12] };
    if (event.key in turns) this.camera.turn(...turns[event.key]);
    else if (event.key === "+" || event.key === "=") this.camera.zoom(0.87);
    else if (event.key === "-") this.camera.zoom(1.15);
    else return;
    event.preventDefault();
    this.redraw();
    this.onTurn();
  }

  // Where a part position stands on the canvas [px].
  onScreen(point) {
    return this.camera.project(point, this.canvas.clientWidth, this.canvas.clientHeight);
  }

  // The nearest of `points` [[x, y, z], ...] within `reach` px of a click, or -1.
  nearest(points, x, y, reach = 28) {
    let best = -1;
    let least = reach;
    points.forEach((point, k) => {
      const [px, py] = this.onScreen(point);
      const far = Math.hypot(px - x, py - y);
      if (far < least) [best, least] = [k, far];
    });
    return best;
  }
}

export function boundsOf(positions) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let k = 0; k < positions.length; k++) {
    const axis = k % 3;
    if (positions[k] < low[axis]) low[axis] = positions[k];
    if (positions[k] > high[axis]) high[axis] = positions[k];
  }
  return [low, high];
}

function repeated(rgb, count) {
  const out = new Uint8Array(3 * count);
  for (let k = 0; k < count; k++) out.set(rgb, 3 * k);
  return out;
}

function spanOf(fingers) {
  if (fingers.size !== 2) return 0;
  const [a, b] = [...fingers.values()];
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
