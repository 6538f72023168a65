// Plan: rows, coverage, tilt and lift-off before anything moves; a dry run in the picture.

import { button, duration, empty, h, number, table } from "./dom.js";
import { Form } from "./form.js";

export class Plan {
  constructor(app, bench) {
    this.app = app;
    this.bench = bench;
    this.form = new Form(app);
    this.element = h("div", {}, h("h2", {}, "Plan"), this.figures(), this.form.element);
  }

  figures() {
    const plan = this.app.overview.summaries.plan;
    if (!plan?.points) return h("div", { class: "card" }, empty("No plan yet", "Choose the technique's values below, save them, then plan."));
    const rows = [
      ["rows, points", `${plan.rows}, ${plan.points}`],
      ["swept coverage", number(100 * plan.swept_coverage, 2, "%")],
      ["largest gap to the path", number(plan.largest_gap_mm, 2, "mm")],
      ["point distance", `${plan.spacing_mm.map((v) => number(v, 2)).join(" / ")} mm`],
      ["row distance", `${plan.row_distance_mm.map((v) => number(v, 2)).join(" / ")} mm`],
      ["tilt, mean and most", `${number(plan.tilt_deg.mean, 1)}, ${number(plan.tilt_deg.max, 1)} deg`],
      ["lift-off, mean and most", `${number(plan.lift_off_mm.mean, 2)}, ${number(plan.lift_off_mm.max, 2)} mm`],
      ["duration", duration(plan.duration_s)],
    ];
    const spots = plan.uncovered.map((spot) => h("div", { class: "warning" }, `Not covered: ${spot.reason}, ${number(spot.area_mm2, 0)} mm²`));
    const notes = (plan.notes || []).map((note) => h("div", { class: "warning" }, note));
    return h("div", { class: "card" }, table(["quantity", "value"], rows), spots, notes, this.colourChoice(), this.dryRun());
  }

  colourChoice() {
    const choice = (name, label) => button(label, () => this.bench.picture.paintPath(name), { kind: "small" });
    return h("div", { class: "row" }, h("span", { class: "tight" }, "Colours:"), choice("tilt_deg", "Tilt"), choice("lift_off_mm", "Lift-off"));
  }

  // The probe runs along the path in the picture; nothing on the rig moves.
  dryRun() {
    this.slider = h("input", { type: "range", min: "0", max: "1000", value: "0", "aria-label": "place along the path" });
    this.where = h("div", { class: "quiet", role: "status" }, "Nothing moves on the rig.");
    this.slider.oninput = () => this.place(Number(this.slider.value) / 1000);
    this.play = button("▶ Dry run in the picture", () => this.toggle(), { id: "dry-run" });
    return h("div", {}, h("div", { class: "row" }, this.play), this.slider, this.where);
  }

  toggle() {
    if (this.timer) {
      clearInterval(this.timer);
      this.timer = null;
      this.play.textContent = "▶ Dry run in the picture";
      return;
    }
    this.play.textContent = "■ End dry run";
    this.timer = setInterval(() => {
      const next = (Number(this.slider.value) + 2) % 1000;
      this.slider.value = String(next);
      this.place(next / 1000);
    }, 60);
  }

  place(share) {
    const plan = this.bench.picture.data.plan?.arrays;
    if (!plan) return;
    const time = share * plan.time_s[plan.time_s.length - 1];
    let k = plan.time_s.findIndex((t) => t >= time);
    if (k < 0) k = plan.time_s.length - 1;
    const three = (array) => Array.from(array.subarray(3 * k, 3 * k + 3));
    this.bench.picture.viewer.setProbe(three(plan.coil), three(plan.axis));
    const kind = ["scanning", "on the way", "approaching"][plan.kind[k]];
    this.where.textContent = `${duration(time)}: ${kind} row ${plan.row[k] + 1}, tilt ${number(plan.tilt_deg[k], 1)} deg, lift-off ${number(plan.lift_off_mm[k], 2)} mm`;
  }

  keeps() {
    return this.form.edited;
  }

  leave() {
    clearInterval(this.timer);
    this.bench.picture.viewer.setProbe(null);
  }
}
