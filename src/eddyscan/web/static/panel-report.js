// Report: one click writes it, one opens it; compare with an earlier inspection side by side.

import { act, ask, askArrays } from "./api.js";
import { spread } from "./colours.js";
import { button, empty, fill, h, number, table } from "./dom.js";
import { channelTitle } from "./picture.js";
import { Viewer } from "./viewer.js";

export class Report {
  constructor(app, bench) {
    this.app = app;
    this.bench = bench;
    const step = app.overview.steps.find((entry) => entry.name === "report");
    const there = step.state !== "missing";
    this.address = h("a", { class: "button", target: "_blank", rel: "noopener", id: "report-link", hidden: true }, "Open the report");
    this.element = h(
      "div",
      {},
      h("h2", {}, "Report"),
      h("div", { class: "card" }, there ? h("p", {}, step.figure) : empty("No report yet", "It gathers everything in one file that works offline."), button("Open the report", () => this.open(), { id: "open-report", disabled: !there }), this.address),
      this.compareCard(),
    );
  }

  async open() {
    const { address } = await act("report", { name: this.app.name });
    this.address.href = address;
    this.address.hidden = false;
    window.open(address, "_blank", "noopener");
  }

  compareCard() {
    this.select = h("select", { "aria-label": "earlier inspection", id: "compare-with" });
    this.result = h("div", {});
    ask("list").then(({ inspections }) => {
      const others = inspections.filter((entry) => entry.name !== this.app.name);
      fill(this.select, others.map((entry) => h("option", { value: entry.name }, `${entry.name} (${entry.part}, ${entry.state})`)));
      if (!others.length) fill(this.result, h("p", { class: "quiet" }, "There is no other inspection to compare with."));
    }).catch(() => {});
    return h("div", { class: "card" }, h("h3", {}, "Compare with an earlier inspection"), this.select, h("div", { class: "row" }, button("Side by side", () => this.compare(), { id: "compare" }), button("One picture", () => this.single())), this.result);
  }

  async compare() {
    const name = this.select.value;
    if (!name) return;
    const other = await ask("overview", { name });
    this.single();
    this.second = new Viewer(name);
    this.bench.picture.frame.append(this.second.element);
    fill(this.result, this.figures(other));
    const surface = await askArrays("scene", { name, scene: "surface" });
    this.second.setSurface(surface.arrays);
    const mine = this.bench.picture.viewer;
    const follow = (from, to) => () => {
      Object.assign(to.camera, { yaw: from.camera.yaw, pitch: from.camera.pitch, distance: from.camera.distance, target: [...from.camera.target] });
      to.redraw();
    };
    mine.onTurn = follow(mine, this.second);
    this.second.onTurn = follow(this.second, mine);
    mine.fit();
    await this.paint(name, other);
  }

  // Both in the same colours, so that the eye may compare.
  async paint(name, other) {
    if (other.steps.find((step) => step.name === "cscan").state === "missing") return;
    const { arrays } = await askArrays("scene", { name, scene: "cscan" });
    const channel = this.bench.picture.shownChannel;
    const theirs = arrays[`channel ${channel}`];
    const mine = this.bench.picture.data.cscan?.arrays[`channel ${channel}`];
    if (!theirs) return;
    const [low, high] = spread([...(mine || []), ...theirs], 0.005);
    this.second.paintSurface(theirs, low, high, "viridis");
    if (mine) this.bench.picture.viewer.paintSurface(mine, low, high, "viridis");
    const spots = other.indications.flatMap((one) => one.centre_mm);
    this.second.setPoints("called", new Float32Array(spots), [255, 255, 255], { px: 13, lift: 0.006 });
    this.bench.picture.viewer.legend({ title: `${channelTitle(channel)}, both pictures`, low: number(low, 3), high: number(high, 3), map: "viridis" });
  }

  figures(other) {
    const here = this.app.overview;
    const value = (of, path) => path.split(".").reduce((at, key) => (at === undefined || at === null ? undefined : at[key]), of);
    const rows = [
      ["surface uncertainty, mm", "summaries.surface.mean_uncertainty_mm", 3],
      ["swept coverage", "summaries.plan.swept_coverage", 4],
      ["points", "summaries.plan.points", 0],
      ["lift-off read, mean, mm", "summaries.cscan.lift_off_mm.mean", 3],
      ["indications", "indications.length", 0],
    ];
    return table(["", here.name, other.name], rows.map(([label, path, digits]) => [label, number(value(here, path), digits), number(value(other, path), digits)]));
  }

  single() {
    this.second?.element.remove();
    this.second = null;
    this.bench.picture.viewer.onTurn = () => {};
    this.bench.picture.viewer.redraw();
  }

  leave() {
    this.single();
  }
}
