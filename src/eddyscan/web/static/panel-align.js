// Align: where the part stands on the stage, and the check of every limit before anything moves.

import { empty, h, table } from "./dom.js";

export class Align {
  constructor(app) {
    this.app = app;
    const step = app.overview.steps.find((entry) => entry.name === "align");
    this.element = h(
      "div",
      {},
      h("h2", {}, "Align"),
      h(
        "div",
        { class: "card" },
        step.figure ? table(["quantity", "value"], [["part on the stage", step.figure]], { class: "words" }) : empty("Not aligned yet", "The scan aligns the part before it starts, and keeps what it found."),
      ),
      h(
        "div",
        { class: "card" },
        h("h3", {}, "Before motion"),
        h("p", {}, "The check reads every axis's travel and compares it with the whole path, links included. Nothing moves."),
        this.told(),
      ),
    );
  }

  told() {
    const job = this.app.job;
    if (!job || job.step !== "check" || job.active || !this.app.name || job.folder.split("/").pop() !== this.app.name) return null;
    if (job.state === "done") return h("div", { class: "big" }, "✓ every target is inside the travel");
    return h("div", { class: "fault" }, job.message);
  }
}
