// Strip chart, impedance plane and lift-off bar on plain canvases, with units on every axis.

function css(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// A canvas of a CSS height that is sharp on every screen; returns its pen.
function pen(canvas, height) {
  const scale = Math.min(devicePixelRatio || 1, 2);
  const width = canvas.clientWidth || 380;
  canvas.style.height = `${height}px`;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const c = canvas.getContext("2d");
  c.setTransform(scale, 0, 0, scale, 0, 0);
  c.clearRect(0, 0, width, height);
  c.font = "13px system-ui, sans-serif";
  return { c, width, height };
}

// Round steps that divide a range into about `count` parts.
export function steps(low, high, count = 4) {
  const raw = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const marks = [];
  for (let k = Math.ceil(low / step); k * step <= high + step * 1e-6; k++) marks.push(k * step);
  return { step, marks, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

// One value per reading against time; marked readings stand out.
export class Strip {
  constructor(canvas) {
    this.canvas = canvas;
    canvas.setAttribute("role", "img");
  }

  draw({ time, values, count, title, unit, limits = [], marked = null, seconds = 0, scale = 1 }) {
    const { c, width, height } = pen(this.canvas, 185);
    this.canvas.setAttribute("aria-label", `strip chart: ${title} [${unit}] against time`);
    c.fillStyle = css("--soft");
    c.fillText(`${title} [${unit}]`, 8, 22);
    if (!count) return c.fillText("no reading yet", width / 2 - 40, height / 2);
    const t1 = time[count - 1];
    const t0 = seconds ? Math.max(time[0], t1 - seconds) : time[0];
    let first = 0;
    while (first < count - 1 && time[first] < t0) first++;
    let [low, high] = [Infinity, -Infinity];
    for (let k = first; k < count; k++) {
      const v = values[k] * scale;
      if (v < low) low = v;
      if (v > high) high = v;
    }
    for (const limit of limits) high = Math.max(high, limit.at * scale);
    if (!Number.isFinite(low)) return c.fillText("no value", width / 2 - 30, height / 2);
    const room = (high - low || Math.abs(high) * 0.01 || 1) * 0.08;
    [low, high] = [low - room, high + room];
    const left = 64;
    const box = { x: left, y: 40, w: width - left - 8, h: height - 62 };
    const x = (t) => box.x + (t1 > t0 ? ((t - t0) / (t1 - t0)) * box.w : box.w);
    const y = (v) => box.y + (1 - (v - low) / (high - low)) * box.h;
    this.frame(c, box, { low, high, t0, t1, x, y });
    this.limits(c, box, limits, y, scale);
    this.line(c, box, { time, values, first, count, x, y, scale });
    if (marked) this.marks(c, { time, values, marked, x, y, first, scale });
    return undefined;
  }

  frame(c, box, { low, high, t0, t1, x, y }) {
    c.strokeStyle = css("--grid");
    c.fillStyle = css("--soft");
    c.lineWidth = 1;
    c.textAlign = "right";
    const v = steps(low, high, 4);
    for (const mark of v.marks) {
      rule(c, box.x, y(mark), box.x + box.w, y(mark));
      c.fillText(mark.toFixed(v.digits), box.x - 6, y(mark) + 4);
    }
    c.textAlign = "center";
    const t = steps(t0, t1, 4);
    for (const mark of t.marks) {
      rule(c, x(mark), box.y, x(mark), box.y + box.h);
      c.fillText(`${mark.toFixed(t.digits)} s`, Math.min(x(mark), box.x + box.w - 16), box.y + box.h + 16);
    }
    c.textAlign = "left";
  }

  limits(c, box, limits, y, scale) {
    c.save();
    c.setLineDash([6, 5]);
    c.lineWidth = 2;
    for (const limit of limits) {
      c.strokeStyle = css(limit.colour || "--warn");
      rule(c, box.x, y(limit.at * scale), box.x + box.w, y(limit.at * scale));
      c.fillStyle = css(limit.colour || "--warn");
      c.fillText(limit.name, box.x + 4, y(limit.at * scale) - 4);
    }
    c.restore();
  }

  // At most two points per pixel column: the least and the greatest.
  line(c, box, { time, values, first, count, x, y, scale }) {
    c.strokeStyle = css("--trace");
    c.lineWidth = 1.8;
    c.beginPath();
    let column = -1;
    let [low, high] = [0, 0];
    const put = () => {
      if (column < 0) return;
      c.lineTo(column, low);
      if (high !== low) c.lineTo(column, high);
    };
    for (let k = first; k < count; k++) {
      if (!Number.isFinite(values[k])) continue;
      const [px, py] = [Math.round(x(time[k])), y(values[k] * scale)];
      if (px !== column) {
        put();
        [column, low, high] = [px, py, py];
      } else [low, high] = [Math.min(low, py), Math.max(high, py)];
    }
    put();
    c.stroke();
  }

  marks(c, { time, values, marked, x, y, first, scale }) {
    c.fillStyle = css("--mark");
    for (const k of marked) {
      if (k < first || !Number.isFinite(values[k])) continue;
      c.beginPath();
      c.arc(x(time[k]), y(values[k] * scale), 4.5, 0, 7);
      c.fill();
    }
  }
}

// Reactance against resistance, turned, amplified, centred on the null point.
export class Plane {
  constructor(canvas) {
    this.canvas = canvas;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "impedance plane: resistance to the right, reactance up");
    Object.assign(this, { turn: 0, gain: 1, keep: 0, null: null });
  }

  draw({ re, im, count, marked = null }) {
    const { c, width, height } = pen(this.canvas, 250);
    const centre = [width / 2, height / 2];
    const zero = this.null || middleOf(re, im, count);
    const first = this.keep ? Math.max(0, count - this.keep) : 0;
    if (!this.span || !this.held) this.span = spanOf(re, im, first, count, zero);
    const px = (0.42 * Math.min(width, height) * this.gain) / this.span;
    this.cross(c, width, height, px);
    const [cos, sin] = [Math.cos((this.turn * Math.PI) / 180), Math.sin((this.turn * Math.PI) / 180)];
    const at = (k) => {
      const [r, x] = [re[k] - zero[0], im[k] - zero[1]];
      return [centre[0] + px * (r * cos - x * sin), centre[1] - px * (r * sin + x * cos)];
    };
    c.fillStyle = css("--trace");
    for (let k = first; k < count; k++) {
      const [x, y] = at(k);
      c.fillRect(x - 1.2, y - 1.2, 2.4, 2.4);
    }
    this.tail(c, at, first, count);
    if (marked) this.marks(c, at, marked);
  }

  cross(c, width, height, px) {
    const { step, digits } = steps(0, width / px, 6);
    c.strokeStyle = css("--grid");
    c.lineWidth = 1;
    for (let x = (width / 2) % (step * px); x < width; x += step * px) rule(c, x, 0, x, height);
    for (let y = (height / 2) % (step * px); y < height; y += step * px) rule(c, 0, y, width, y);
    c.strokeStyle = css("--soft");
    rule(c, width / 2, 0, width / 2, height);
    rule(c, 0, height / 2, width, height / 2);
    c.fillStyle = css("--soft");
    c.fillText("R →", width - 30, height / 2 - 6);
    c.fillText("X ↑", width / 2 + 6, 14);
    c.fillText(`${perDivision(step, digits)} per division`, 8, height - 8);
  }

  tail(c, at, first, count) {
    if (count <= first) return;
    c.strokeStyle = css("--trace-2");
    c.lineWidth = 1.6;
    c.beginPath();
    for (let k = Math.max(first, count - 40); k < count; k++) c.lineTo(...at(k));
    c.stroke();
    const [x, y] = at(count - 1);
    c.fillStyle = css("--mark");
    c.beginPath();
    c.arc(x, y, 5, 0, 7);
    c.fill();
  }

  marks(c, at, marked) {
    c.strokeStyle = css("--mark");
    c.fillStyle = css("--mark");
    c.lineWidth = 1.5;
    c.beginPath();
    for (const k of marked) c.lineTo(...at(k));
    c.stroke();
    for (const k of marked) {
      const [x, y] = at(k);
      c.fillRect(x - 3, y - 3, 6, 6);
    }
  }
}

// Distance of the coil to the surface now, with the planned value and the limit.
export class LiftBar {
  constructor(canvas) {
    this.canvas = canvas;
    canvas.setAttribute("role", "meter");
    canvas.setAttribute("aria-label", "lift-off [mm]");
  }

  draw({ value, planned, limit }) {
    const { c, width } = pen(this.canvas, 74);
    const top = Math.max(limit * 1.25, value || 0, 0.1);
    const box = { x: 10, y: 28, w: width - 20, h: 22 };
    const x = (mm) => box.x + (Math.max(0, mm) / top) * box.w;
    const over = value !== null && value > limit;
    this.canvas.setAttribute("aria-valuenow", value === null ? "" : value.toFixed(3));
    c.fillStyle = css("--line");
    c.fillRect(box.x, box.y, box.w, box.h);
    if (value !== null && Number.isFinite(value)) {
      c.fillStyle = css(over ? "--bad" : "--good");
      c.fillRect(box.x, box.y, x(value) - box.x, box.h);
    }
    c.fillStyle = css("--ink");
    c.font = "600 17px system-ui, sans-serif";
    const words = value === null || !Number.isFinite(value) ? "no reading yet" : `${value.toFixed(2)} mm${over ? "  TOO FAR" : ""}`;
    c.fillText(`Lift-off ${words}`, box.x, 18);
    c.font = "13px system-ui, sans-serif";
    for (const [at, name, colour] of [[planned, "planned", "--ink"], [limit, "limit", "--bad"]]) {
      c.fillStyle = css(colour);
      c.fillRect(x(at) - 1.5, box.y - 4, 3, box.h + 8);
      c.textAlign = "center";
      c.fillText(`${name} ${at.toFixed(2)}`, Math.min(Math.max(x(at), 40), width - 44), box.y + box.h + 18);
      c.textAlign = "left";
    }
  }
}

function rule(c, x0, y0, x1, y1) {
  c.beginPath();
  c.moveTo(Math.round(x0) + 0.5, Math.round(y0) + 0.5);
  c.lineTo(Math.round(x1) + 0.5, Math.round(y1) + 0.5);
  c.stroke();
}

function perDivision(step, digits) {
  return step >= 0.1 ? `${step.toFixed(digits)} Ω` : step >= 1e-4 ? `${+(1e3 * step).toPrecision(2)} mΩ` : `${+(1e6 * step).toPrecision(2)} µΩ`;
}

function middleOf(re, im, count) {
  let [r, x, n] = [0, 0, 0];
  for (let k = 0; k < count; k++) {
    if (!Number.isFinite(re[k]) || !Number.isFinite(im[k])) continue;
    r += re[k];
    x += im[k];
    n++;
  }
  return n ? [r / n, x / n] : [0, 0];
}

function spanOf(re, im, first, count, zero) {
  let most = 0;
  for (let k = first; k < count; k++) {
    const far = Math.hypot(re[k] - zero[0], im[k] - zero[1]);
    if (far > most) most = far;
  }
  return most || 1;
}
