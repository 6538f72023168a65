// Scan: what the coil reads, live; where it is; how far it is from the surface.

import { LiftBar, Plane, Strip } from "./charts.js";
import { button, empty, h, number, ohms } from "./dom.js";
import { LIVE_CHANNELS } from "./picture.js";

export class Scan {
  constructor(app, bench) {
    this.app = app;
    this.bench = bench;
    this.strip = new Strip(h("canvas", { class: "chart" }));
    this.plane = new Plane(h("canvas", { class: "chart" }));
    this.bar = new LiftBar(h("canvas", { class: "chart" }));
    this.state = h("div", { role: "status" });
    this.now = h("div", { class: "quiet" });
    this.element = h("div", {}, h("h2", {}, "Scan"), this.state, h("div", { class: "card" }, this.bar.canvas, this.now), this.planeCard());
    bench.picture.dock.replaceChildren(this.stripCard());
    this.seen = -1;
  }

  stripCard() {
    const select = h("select", { "aria-label": "channel", id: "channel" }, Object.entries(LIVE_CHANNELS).map(([key, facts]) => h("option", { value: key }, `${facts.title} [${facts.unit}]`)));
    select.value = this.bench.picture.channel;
    select.onchange = () => {
      this.bench.picture.channel = select.value;
      this.bench.picture.paintReadings(true);
      this.draw();
    };
    this.window = h("select", { "aria-label": "time shown" }, [["0", "all"], ["10", "last 10 s"], ["60", "last minute"]].map(([value, label]) => h("option", { value }, label)));
    this.window.onchange = () => this.draw();
    return h("div", { class: "strip" }, h("div", { class: "pick" }, select, this.window), this.strip.canvas);
  }

  planeCard() {
    const slider = (label, min, max, value, put) => {
      const shown = h("output", {}, label(value));
      const input = h("input", { type: "range", min, max, value, "aria-label": label(value).split(" ")[0] });
      input.oninput = () => {
        shown.textContent = label(Number(input.value));
        put(Number(input.value));
        this.draw();
      };
      return h("label", {}, shown, input);
    };
    const turn = slider((v) => `Rotation ${v} deg`, -180, 180, 0, (v) => (this.plane.turn = v));
    const gain = slider((v) => `Gain ${v} dB`, 0, 40, 0, (v) => (this.plane.gain = 10 ** (v / 20)));
    const keep = slider((v) => (v === 0 ? "Persistence all" : `Persistence last ${v * 50}`), 0, 20, 0, (v) => (this.plane.keep = v * 50));
    const zero = button("Null here", () => {
      const last = this.app.readings.last();
      this.plane.null = last ? [last.resistance_ohm, last.reactance_ohm] : null;
      this.draw();
    }, { kind: "small" });
    return h("div", { class: "card" }, h("h3", {}, "Impedance plane"), this.plane.canvas, h("div", { class: "row" }, turn, gain), h("div", { class: "row" }, keep, h("span", { class: "tight" }, zero)));
  }

  leave() {
    this.bench.picture.dock.replaceChildren();
  }

  loaded() {
    this.jobChanged();
    this.draw();
  }

  jobChanged() {
    const job = this.app.job;
    const mine = job && job.step === "record" && job.folder.split("/").pop() === this.app.name;
    const step = this.app.overview.steps.find((entry) => entry.name === "record");
    this.state.replaceChildren();
    if (mine && job.state === "paused") this.state.append(h("div", { class: "warning" }, "Paused. The probe waits on the surface. Press Go on, or Stop."));
    else if (mine && job.state === "stopped") this.state.append(h("div", { class: "warning" }, `${job.message} Press “Go on with the scan” to read what is missing.`));
    else if (mine && job.state === "failed") this.state.append(h("div", { class: "fault" }, job.message));
    else if (!this.app.readings.count && !(mine && job.active)) this.state.append(h("div", { class: "card" }, step.state === "missing" ? empty("Nothing scanned yet", "Start the scan when the plan is good and the part is clamped. Stop is always at the top right, and on the Esc key.") : empty("Loading", "…")));
  }

  news() {
    if (this.app.readings.count !== this.seen) this.draw();
  }

  draw() {
    const readings = this.app.readings;
    if (this.seen === -1 && readings.count) this.jobChanged();
    this.seen = readings.count;
    const channel = this.bench.picture.channel;
    const facts = LIVE_CHANNELS[channel];
    const lift = this.app.overview.lift_off_mm;
    const limits = channel === "lift_off_mm" ? [{ at: lift.limit, name: "limit", colour: "--bad" }, { at: lift.planned, name: "planned", colour: "--soft" }] : [];
    this.strip.draw({ time: readings.column("shown_s"), values: readings.column(channel), count: readings.count, title: facts.title, unit: facts.unit, limits, seconds: Number(this.window.value) });
    this.plane.draw({ re: readings.column("resistance_ohm"), im: readings.column("reactance_ohm"), count: readings.count });
    const last = readings.last();
    this.bar.draw({ value: last ? last.lift_off_mm : null, planned: lift.planned, limit: lift.limit });
    this.now.textContent = last ? `reading ${readings.count}, row ${last.row + 1}, point ${last.point + 1} at ${number(last.x_mm, 1)}, ${number(last.y_mm, 1)}, ${number(last.z_mm, 1)} mm; R ${ohms(last.resistance_ohm)}, X ${ohms(last.reactance_ohm)}; lift-off as the coil tells it` : "";
  }
}
