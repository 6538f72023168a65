// Results: indications on the surface, in the chart and in the plane at once; decisions with name and time.

import { ask } from "./api.js";
import { Plane, Strip } from "./charts.js";
import { button, empty, fill, h, number, ohms, say } from "./dom.js";
import { channelTitle } from "./picture.js";

const VERDICTS = { accept: "accepted", reject: "rejected", comment: "commented" };

export class Results {
  constructor(app, bench) {
    this.app = app;
    this.bench = bench;
    this.viewer = bench.picture.viewer;
    this.strip = new Strip(h("canvas", { class: "chart" }));
    this.plane = new Plane(h("canvas", { class: "chart" }));
    this.list = h("div", { class: "card" });
    this.about = h("div", {});
    this.channels = h("div", {});
    this.chosen = bench.chosenIndication || null;
    const charts = h("div", { class: "card" }, h("h3", {}, "Impedance plane of the residual"), this.plane.canvas, h("p", { class: "quiet" }, "Residual: reading minus sound metal at that lift-off and tilt."));
    bench.picture.dock.replaceChildren(h("div", { class: "strip" }, this.strip.canvas));
    this.element = h("div", {}, h("h2", {}, "Results"), this.list, this.about, this.channels, charts);
    this.drawList();
  }

  get called() {
    return this.app.overview.indications;
  }

  loaded() {
    const results = this.bench.picture.data.cscan;
    if (results) this.drawChannels();
    this.viewer.onPick = (x, y) => {
      const k = this.viewer.nearest(this.called.map((one) => one.centre_mm), x, y);
      if (k >= 0) this.choose(this.called[k].number);
    };
    this.markers();
    this.draw();
    if (!this.keeps()) this.drawAbout();
  }

  keeps() {
    return Boolean(this.element.querySelector("#comment")?.value);
  }

  leave() {
    this.viewer.onPick = () => {};
    this.bench.picture.dock.replaceChildren();
  }

  drawChannels() {
    const names = this.bench.picture.cscanChannels || [];
    const select = h("select", { "aria-label": "what the colours show", id: "cscan-channel" }, names.map((name) => h("option", { value: name }, channelTitle(name))));
    select.value = this.bench.picture.shownChannel;
    select.onchange = () => this.bench.picture.paintCscan(select.value);
    fill(this.channels, h("div", { class: "card" }, h("label", {}, "Colours on the surface", select)));
  }

  drawList() {
    const step = this.app.overview.steps.find((entry) => entry.name === "cscan");
    if (step.state === "missing") return fill(this.list, empty("No results yet", "After the scan, find the indications."));
    if (!this.called.length) return fill(this.list, empty("No indication", "Nothing above the call level. What was not covered is grey in the picture."));
    const rows = this.called.map((one) => this.rowOf(one));
    const heads = ["No.", "x, y mm", "length mm", "SNR", "decision"];
    return fill(this.list, h("table", { class: "called" }, h("thead", {}, h("tr", {}, heads.map((head) => h("th", { scope: "col" }, head)))), h("tbody", {}, rows)));
  }

  rowOf(one) {
    const decision = this.lastOf(one);
    const open = h("button", { type: "button", class: "small", id: `indication-${one.number}`, onclick: () => this.choose(one.number) }, String(one.number));
    const cells = [
      open,
      `${number(one.centre_mm[0], 1)}, ${number(one.centre_mm[1], 1)}`,
      one.length_mm === null ? `~ ${number(one.extent_mm, 1)}` : `${number(one.length_mm, 1)} ± ${number(one.length_uncertainty_mm, 1)}`,
      number(one.snr, 1),
      decision ? VERDICTS[decision.verdict] : "open",
    ];
    return h("tr", { class: one.number === this.chosen ? "chosen" : "", onclick: () => this.choose(one.number) }, cells.map((cell) => h("td", {}, cell)));
  }

  decisionsOf(one) {
    const near = (entry) => !entry.centre_mm || Math.hypot(...entry.centre_mm.map((v, k) => v - one.centre_mm[k])) < 3;
    return this.app.overview.decisions.filter((entry) => entry.number === one.number && near(entry));
  }

  lastOf(one) {
    const made = this.decisionsOf(one);
    return made.filter((entry) => entry.verdict !== "comment").pop() || made.pop();
  }

  choose(number_) {
    this.chosen = number_;
    this.bench.chosenIndication = number_;
    this.drawList();
    this.drawAbout();
    this.markers();
    this.draw();
    this.list.querySelector(`#indication-${number_}`)?.focus({ preventScroll: true });
  }

  get one() {
    return this.called.find((entry) => entry.number === this.chosen);
  }

  markers() {
    const here = this.one ? ring(this.one.centre_mm, Math.max(4, this.one.extent_mm / 2 + 2)) : [];
    this.viewer.setSegments("here", new Float32Array(here), [255, 70, 160], { px: 4, lift: 0.008 });
  }

  // The chosen indication's readings stand out in both charts.
  draw() {
    const readings = this.app.readings;
    const results = this.bench.picture.data.cscan?.arrays;
    const n = results ? Math.min(readings.count, results.lift_off_mm.length) : 0;
    const marked = this.one ? readings.near(this.one.centre_mm, Math.max(4, this.one.extent_mm / 2 + 2)).filter((k) => k < n) : null;
    const size = results ? Float64Array.from(results.residual_re_ohm, (re, k) => Math.hypot(re, results.residual_im_ohm[k])) : new Float64Array(0);
    this.strip.draw({ time: readings.column("shown_s"), values: size, count: n, title: "Residual, amplitude", unit: "mΩ", scale: 1e3, marked });
    this.plane.null = [0, 0];
    this.plane.draw({ re: results?.residual_re_ohm || [], im: results?.residual_im_ohm || [], count: n, marked });
  }

  drawAbout() {
    const one = this.one;
    if (!one) return fill(this.about);
    const sized = one.depth_mm === null ? "not sized" : `${number(one.depth_mm, 2)} ± ${number(one.depth_uncertainty_mm, 2)} mm`;
    const facts = `${number(one.extent_mm, 1)} mm along ${number(one.angle_deg, 0)} deg; ${ohms(one.amplitude_ohm)} at ${number(one.phase_deg, 0)} deg; depth ${sized}.`;
    const past = this.decisionsOf(one).map((entry) => h("li", {}, `${entry.time.replace("T", " ").slice(0, 16)} UTC, ${entry.name}: ${VERDICTS[entry.verdict]}${entry.comment ? ` – ${entry.comment}` : ""}`));
    return fill(this.about, h("div", { class: "card" }, h("h3", {}, `Indication ${one.number}`), h("p", {}, facts), past.length ? h("ul", { id: "decisions" }, past) : null, this.app.mayAct ? this.decide(one) : null));
  }

  decide(one) {
    const name = h("input", { id: "who", value: localStorage.getItem("name") || "", placeholder: "your name", autocomplete: "name", "aria-label": "your name" });
    const comment = h("input", { id: "comment", placeholder: "comment", "aria-label": "comment" });
    const put = async (verdict) => {
      localStorage.setItem("name", name.value.trim());
      const entry = await ask("decide", { name: this.app.name, decision: { number: one.number, verdict, name: name.value, comment: comment.value } });
      this.app.overview.decisions.push(entry);
      comment.value = "";
      this.drawList();
      this.drawAbout();
      say(`Indication ${one.number} ${VERDICTS[verdict]} by ${entry.name}.`);
    };
    const choice = (verdict, label, kind) => button(label, () => put(verdict), { kind, id: `decide-${verdict}` });
    return h("div", {}, h("div", { class: "row" }, name, comment), h("div", { class: "row" }, choice("accept", "Accept"), choice("reject", "Reject"), choice("comment", "Comment")));
  }
}

// A ring around a spot, in the x-y plane and upright, as segments.
function ring([x, y, z], radius) {
  const out = [];
  for (let k = 0; k < 32; k++) {
    const [a, b] = [(k * Math.PI) / 16, ((k + 1) * Math.PI) / 16];
    out.push(x + radius * Math.cos(a), y + radius * Math.sin(a), z + 0.6, x + radius * Math.cos(b), y + radius * Math.sin(b), z + 0.6);
  }
  out.push(x, y, z, x, y, z + 18);
  return out;
}
