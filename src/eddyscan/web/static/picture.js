// What the picture shows at each step, and how the live readings get into it.

import { button, h, number, say } from "./dom.js";
import { colours, spread } from "./colours.js";
import { Viewer } from "./viewer.js";

const LAYERS = {
  views: ["cloud", "eyes"],
  surface: ["surface", "eyes"],
  plan: ["surface", "path", "uncovered", "probe", "probe tip"],
  align: ["surface", "path", "probe", "probe tip"],
  record: ["surface", "route", "readings", "probe", "probe tip"],
  cscan: ["surface", "called", "here"],
  report: ["surface", "called", "here"],
};
const CHOICES = { cloud: "Points", surface: "Surface", eyes: "Cameras", path: "Path", readings: "Readings", called: "Indications" };
const NEEDS = { surface: "surface", plan: "plan", record: "record", cscan: "cscan" };
const EMPTY = {
  views: ["No views yet", "Take views with the camera, or drop files on the right."],
  surface: ["No surface yet", "Make the surface from the views."],
  plan: ["No plan yet", "The plan needs the surface."],
  align: ["Nothing to align yet", "Make the surface and the plan first."],
  record: ["Nothing scanned yet", "The scan needs a plan."],
  cscan: ["No results yet", "Scan the part first."],
  report: ["No results yet", "Scan the part first."],
};
export const LIVE_CHANNELS = {
  reactance_ohm: { title: "Reactance X", unit: "Ω", digits: 3 },
  resistance_ohm: { title: "Resistance R", unit: "Ω", digits: 3 },
  lift_off_mm: { title: "Lift-off by the coil", unit: "mm", digits: 2 },
};

export class Picture {
  constructor(app, bench) {
    this.app = app;
    this.bench = bench;
    this.viewer = new Viewer();
    this.frame = h("div", { id: "picture" }, this.viewer.element);
    this.dock = h("div", { id: "dock" });
    this.element = h("section", { id: "centre", "aria-label": "picture of the part" }, this.frame, this.dock);
    this.data = {};
    this.stamps = {};
    this.channel = "reactance_ohm";
    this.drawn = 0;
    this.tools();
  }

  tools() {
    const look = (name, label) => button(label, () => { this.viewer.camera.look(name); this.viewer.fit(); }, { kind: "small" });
    this.toggles = this.viewer.tools;
    this.viewer.looks.append(look("corner", "3-D"), look("top", "Top"), look("front", "Side"), button("Fit", () => this.viewer.fit(), { kind: "small" }));
  }

  // Load what the folder has and what is not loaded yet.
  async load() {
    const states = Object.fromEntries(this.app.overview.steps.map((step) => [step.name, step]));
    for (const [scene, step] of Object.entries(NEEDS)) {
      const { state, figure, seconds } = states[step];
      const stamp = state === "missing" ? "" : `${figure} ${seconds}`;
      if (stamp === this.stamps[scene] && scene !== "record") continue;
      this.stamps[scene] = stamp;
      if (stamp) await this.fetch(scene);
      else this.forget(scene);
    }
    const spots = this.app.overview.indications.flatMap((one) => one.centre_mm);
    if (spots.length) this.viewer.setPoints("called", new Float32Array(spots), [255, 255, 255], { px: 13, lift: 0.006 });
    else this.viewer.set("called", null);
    this.show(this.bench.step);
  }

  async fetch(scene) {
    try {
      this.data[scene] = await this.app.scene(scene);
      this[`on_${scene}`]?.(this.data[scene]);
    } catch (fault) {
      this.forget(scene);
      say(fault.message, "error");
    }
  }

  forget(scene) {
    delete this.data[scene];
    const layers = { surface: ["surface", "cloud", "eyes"], plan: ["path", "route", "uncovered"], record: ["readings"], cscan: ["called", "here"] };
    for (const name of layers[scene]) this.viewer.set(name, null);
  }

  on_surface({ arrays, facts }) {
    this.viewer.fitted = false;
    this.viewer.setSurface(arrays);
    this.eyes(facts.views);
    this.app.scene("cloud").then(({ arrays: cloud, facts: of }) => {
      this.data.cloud = { arrays: cloud, facts: of };
      const heights = cloud.points.filter((_, k) => k % 3 === 2);
      this.viewer.setPoints("cloud", cloud.points, colours(heights, ...spread(heights, 0.02), "cividis"), { px: 2.5 });
      this.show(this.bench.step);
    }).catch(() => {});
  }

  // Each camera as a small pyramid where it stood.
  eyes(views) {
    const segments = [];
    for (const view of views) {
      const T = view.T_part_view;
      const to = (p) => [0, 1, 2].map((r) => T[r][0] * p[0] + T[r][1] * p[1] + T[r][2] * p[2] + T[r][3]);
      const tip = to([0, 0, 0]);
      const corners = [[-14, -10, 26], [14, -10, 26], [14, 10, 26], [-14, 10, 26]].map(to);
      corners.forEach((corner, k) => segments.push(...tip, ...corner, ...corner, ...corners[(k + 1) % 4]));
    }
    this.viewer.setSegments("eyes", new Float32Array(segments), [120, 140, 160], { px: 1.5 });
  }

  on_plan({ arrays, facts }) {
    this.paintPath("tilt_deg");
    const n = arrays.kind.length;
    const pale = new Uint8Array(3 * n).fill(128);
    this.viewer.setPath("route", arrays.coil, pale, { px: 1 });
    const spots = facts.uncovered.filter((spot) => spot.centre_mm && !spot.reason.includes("edge zone")).flatMap((spot) => spot.centre_mm);
    this.viewer.setPoints("uncovered", new Float32Array(spots), [209, 0, 108], { px: 16, lift: 0.004 });
  }

  // The path in the colours of a planned value; links and approaches in grey.
  paintPath(name) {
    const { arrays } = this.data.plan;
    const values = Float64Array.from(arrays[name], (value, k) => (arrays.kind[k] === 0 ? value : NaN));
    const [low, high] = spread(values, 0);
    this.viewer.setPath("path", arrays.coil, colours(values, low, high, "viridis", [120, 130, 140]), { px: 3 });
    this.pathLegend = { title: name === "tilt_deg" ? "Tilt of the probe [deg]" : "Predicted lift-off [mm]", low: number(low, 2), high: number(high, 2), map: "viridis" };
    if (this.bench.step === "plan") this.viewer.legend(this.pathLegend);
  }

  on_record({ arrays }) {
    this.app.readings.addTable(arrays.rows);
    this.paintReadings(true);
  }

  on_cscan({ arrays }) {
    this.cscanChannels = Object.keys(arrays).filter((name) => name.startsWith("channel ")).map((name) => name.slice(8));
    const wanted = ["score", "residual_ohm", "amplitude_ohm", "lift_off_mm"].find((name) => this.cscanChannels.includes(name));
    this.shownChannel = this.cscanChannels.includes(this.shownChannel) ? this.shownChannel : wanted;
  }

  // ---- showing ----

  show(step) {
    const shown = LAYERS[step] || [];
    if (step === "plan" || step === "align") this.viewer.setProbe(null);
    this.viewer.show(shown);
    this.paint(step);
    const missing = step === "views" ? !this.viewer.has("cloud") : !this.viewer.has("surface");
    const words = EMPTY[step];
    this.viewer.say(missing && words ? h("div", { class: "empty" }, h("h3", {}, words[0]), h("p", {}, words[1])) : null);
    this.toggle(shown);
  }

  toggle(shown) {
    this.toggled = this.viewer.has("readings");
    const names = Object.keys(CHOICES).filter((name) => this.viewer.has(name));
    this.toggles.replaceChildren(
      ...names.map((name) => {
        const made = h("button", { type: "button", class: "small", "aria-pressed": String(shown.includes(name)) }, CHOICES[name]);
        made.onclick = () => {
          const on = made.getAttribute("aria-pressed") !== "true";
          made.setAttribute("aria-pressed", String(on));
          this.viewer.hidden[on ? "delete" : "add"](name);
          this.viewer.redraw();
        };
        return made;
      }),
    );
  }

  paint(step) {
    this.viewer.paintSurface(null);
    this.viewer.legend(null);
    const uncertainty = this.data.surface?.arrays.uncertainty_mm;
    if (step === "surface" && uncertainty) {
      const [low, high] = [0, spread(uncertainty, 0.02)[1]];
      this.viewer.paintSurface(uncertainty, low, high, "cividis");
      this.viewer.legend({ title: "Uncertainty of the surface [mm]", low: number(low, 3), high: number(high, 3), map: "cividis" });
    } else if (step === "plan" && this.data.plan) this.viewer.legend(this.pathLegend);
    else if (step === "record") this.paintReadings(true);
    else if ((step === "cscan" || step === "report") && this.data.cscan) this.paintCscan(this.shownChannel);
  }

  paintCscan(name) {
    this.shownChannel = name;
    const values = this.data.cscan.arrays[`channel ${name}`];
    const covered = this.data.cscan.arrays.covered;
    if (!values) return;
    const seen = Float64Array.from(values, (value, k) => (covered[k] ? value : NaN));
    const [low, high] = spread(seen, 0.005);
    this.viewer.paintSurface(seen, low, high, "viridis");
    this.viewer.legend({ title: `${channelTitle(name)}; grey: not covered`, low: number(low, 3), high: number(high, 3), map: "viridis" });
  }

  // The readings as discs on the surface; only what is new costs anything much.
  paintReadings(all = false) {
    const readings = this.app.readings;
    if (!readings.count) {
      this.viewer.set("readings", null);
      this.viewer.setProbe(null);
      return;
    }
    if (!all && readings.count === this.drawn) return;
    this.drawn = readings.count;
    const values = readings.column(this.channel);
    if (all || !this.range || readings.count < 400 || performance.now() - this.ranged > 2000) {
      this.range = spread(values, 0.01);
      this.ranged = performance.now();
    }
    const size = this.app.overview.summaries.plan?.spacing_mm?.[1] || 4;
    this.viewer.setPoints("readings", readings.positions(), colours(values, ...this.range), { px: 4, mm: 0.95 * size, lift: 0.003 });
    const facts = LIVE_CHANNELS[this.channel];
    if (this.bench.step === "record" && !this.toggled) this.toggle(LAYERS.record);
    if (this.bench.step === "record") this.viewer.legend({ title: `${facts.title} [${facts.unit}], raw`, low: number(this.range[0], facts.digits), high: number(this.range[1], facts.digits), map: "viridis" });
    this.probeAtLast();
  }

  probeAtLast() {
    const last = this.app.readings.last();
    if (last) this.viewer.setProbe([last.x_mm, last.y_mm, last.z_mm], this.axisNear(last));
  }

  axisNear({ row, point }) {
    const plan = this.data.plan?.arrays;
    if (!plan) return [0, 0, -1];
    if (!this.poseOf || this.poseOf.plan !== plan) {
      this.poseOf = { plan, index: new Map() };
      for (let k = 0; k < plan.row.length; k++) if (plan.kind[k] === 0) this.poseOf.index.set(plan.row[k] * 1e6 + plan.point[k], k);
    }
    const k = this.poseOf.index.get(row * 1e6 + point);
    return k === undefined ? [0, 0, -1] : Array.from(plan.axis.subarray(3 * k, 3 * k + 3));
  }

  news() {
    if (this.app.scanningHere && this.bench.step === "record") this.paintReadings();
  }
}

export function channelTitle(name) {
  const unit = name.endsWith("_ohm") ? "Ω" : name.endsWith("_mm") ? "mm" : "";
  if (name === "score") return "Score: residual over its noise";
  const words = name.replace(/_(ohm|mm)$/, "").replaceAll("_", " ");
  return `${words[0].toUpperCase()}${words.slice(1)}${unit ? ` [${unit}]` : ""}`;
}
