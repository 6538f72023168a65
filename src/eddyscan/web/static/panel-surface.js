// Surface: how good it is; crop box and turn for when the automatic choice is wrong.

import { ask } from "./api.js";
import { button, empty, fill, h, number, say, table } from "./dom.js";
import { boundsOf } from "./viewer.js";

const AXES = ["x", "y", "z"];

export class Surface {
  constructor(app, bench) {
    this.app = app;
    this.bench = bench;
    this.viewer = bench.picture.viewer;
    this.element = h("div", {}, h("h2", {}, "Surface"), this.figures(), this.cropCard());
  }

  figures() {
    const summary = this.app.overview.summaries.surface;
    if (!summary?.vertices) return h("div", { class: "card" }, empty("No surface yet", "It is made from the views in 1-views, without any hand-typed guess."));
    const rows = [
      ["size", summary.size_mm.map((side) => number(side, 1)).join(" × ") + " mm"],
      ["area", `${number(summary.area_mm2 / 100, 1)} cm²`],
      ["mesh", `${summary.vertices} vertices, ${summary.faces} triangles`],
      ["mean uncertainty", number(summary.mean_uncertainty_mm, 3, "mm")],
      ["method", summary.method],
    ];
    const nominal = summary.nominal;
    if (nominal) {
      rows.push([`against ${nominal.name}, mean`, number(nominal.fit.mean_abs_mm, 3, "mm")]);
      rows.push(["95 % below", number(nominal.fit.p95_mm, 3, "mm")]);
    }
    const warnings = (summary.warnings || []).map((text) => h("div", { class: "warning" }, text));
    return h("div", { class: "card" }, table(["quantity", "value"], rows), warnings);
  }

  cropCard() {
    if (!this.app.mayAct) return null;
    this.place = h("div", { class: "card" });
    this.drawCrop();
    return this.place;
  }

  drawCrop() {
    const kept = this.app.overview.crop;
    if (!this.box && !kept) {
      fill(
        this.place,
        h("h3", {}, "Is the wrong thing in the picture?"),
        h("p", { class: "quiet" }, "The part is found by itself. If it took something else along, draw a box around the part, or turn it."),
        button("Crop or turn by hand", () => this.begin(), { id: "crop", disabled: !this.viewer.bounds }),
      );
      return;
    }
    if (!this.box) this.boxFrom(kept);
    const back = button("Back to automatic", () => this.save(null), { id: "crop-off" });
    const keep = button("Use this box", () => this.save(this.values()), { kind: "main", id: "crop-save" });
    fill(this.place, h("h3", {}, "Crop box"), h("p", { class: "quiet" }, "Drag the orange handles in the picture, or type limits in mm."), this.inputs(), this.turns(), h("div", { class: "row" }, keep, back));
  }

  begin() {
    this.boxFrom(null);
    this.drawCrop();
  }

  boxFrom(kept) {
    const [low, high] = this.viewer.bounds || [[0, 0, 0], [100, 100, 50]];
    const seen = this.bench.picture.data.cloud ? boundsOf(this.bench.picture.data.cloud.arrays.points) : [low, high];
    this.box = AXES.map((axis, k) => kept?.[`${axis}_mm`] || [Math.floor(seen[0][k]), Math.ceil(seen[1][k])]);
    this.turn = kept?.rotate_xyz_deg ? [...kept.rotate_xyz_deg] : [0, 0, 0];
    const crop = this.viewer.crop;
    crop.onChange = (box) => this.follow(box);
    crop.onRelease = (box) => this.follow(box);
    crop.set(this.box);
    this.viewer.fit();
  }

  inputs() {
    this.fields = [];
    return h("div", {}, AXES.map((axis, k) => h("div", { class: "row" }, h("strong", { class: "tight" }, axis), [0, 1].map((side) => this.input(axis, k, side)), h("span", { class: "tight" }, "mm"))));
  }

  input(axis, k, side) {
    const field = h("input", { type: "number", step: "0.5", value: this.box[k][side].toFixed(1), "aria-label": `${axis} ${side ? "upper" : "lower"} limit in mm`, id: `crop-${axis}-${side}` });
    field.oninput = () => {
      const value = Number(field.value);
      const good = field.value !== "" && Number.isFinite(value) && (side ? value > this.box[k][0] : value < this.box[k][1]);
      field.setAttribute("aria-invalid", String(!good));
      if (!good) return;
      this.box[k][side] = value;
      this.viewer.crop.set(this.box);
    };
    this.fields.push({ field, k, side });
    return field;
  }

  turns() {
    const shown = h("span", {}, this.turnWords());
    const by = (k, angle, label) =>
      button(label, () => {
        this.turn[k] = ((this.turn[k] + angle + 540) % 360) - 180;
        fill(shown, this.turnWords());
      }, { kind: "small" });
    return h("div", {}, h("p", {}, "Turn the part: ", shown), h("div", { class: "row" }, by(2, 90, "about z 90°"), by(2, 1, "z +1°"), by(2, -1, "z −1°"), by(0, 180, "upside down")));
  }

  turnWords() {
    return this.turn.map((angle, k) => `${AXES[k]} ${angle.toFixed(0)}°`).join(", ");
  }

  follow(box) {
    this.box = box.map((side) => [...side]);
    for (const { field, k, side } of this.fields || []) {
      field.value = box[k][side].toFixed(1);
      field.removeAttribute("aria-invalid");
    }
  }

  values() {
    const limits = Object.fromEntries(AXES.map((axis, k) => [`${axis}_mm`, this.box[k].map((v) => Math.round(10 * v) / 10)]));
    return { ...limits, rotate_xyz_deg: this.turn };
  }

  async save(crop) {
    if (this.element.querySelector('[aria-invalid="true"]')) throw new Error("A limit of the crop box is not usable: the lower one must be below the upper one.");
    await ask("save", { name: this.app.name, changes: { surface: { crop } } });
    this.saved = true;
    say(crop ? "The crop box is in the technique. Make the surface again." : "Back to automatic. Make the surface again.");
  }

  loaded() {
    if (this.place && this.app.overview.crop) this.drawCrop();
    const begin = this.place?.querySelector("#crop");
    if (begin) begin.disabled = !this.viewer.bounds;
  }

  keeps() {
    return Boolean(this.box) && !this.saved;
  }

  leave() {
    this.viewer.crop.set(null);
  }
}
