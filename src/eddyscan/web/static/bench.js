// One inspection: the steps on the left, the picture in the middle, the chosen step's details on the right.

import { fill, h } from "./dom.js";
import { Picture } from "./picture.js";
import { panels } from "./panels.js";

const SIGNS = { done: "✓", missing: "○", stale: "↻", partial: "◐", running: "◌", failed: "!", stopped: "■" };
const WORDS = { done: "done", missing: "to do", stale: "out of date", partial: "not finished", running: "under way", failed: "failed", stopped: "stopped" };
const RUNS = { views: "views", surface: "surface", plan: "plan", align: "check", record: "record", cscan: "cscan", report: "report" };
const LABELS = {
  views: "Take views",
  surface: "Make surface",
  plan: "Plan the scan",
  align: "Check before motion",
  record: "Start scan",
  cscan: "Find indications",
  report: "Write report",
};

export class Bench {
  constructor(app, step) {
    this.app = app;
    this.picture = new Picture(app, this);
    this.list = h("nav", { id: "steps", "aria-label": "steps of the inspection" });
    this.details = h("section", { id: "details", "aria-label": "details of the step" });
    this.element = h("div", { class: "bench" }, this.list, this.picture.element, this.details);
    this.step = step || this.nextStep();
    this.panel = null;
  }

  // The first step that is not done, or the results.
  nextStep() {
    const open = this.app.overview.steps.find((step) => step.state !== "done" && step.name !== "align");
    return open ? open.name : "cscan";
  }

  async load() {
    this.drawSteps();
    this.showPanel();
    await this.picture.load();
    this.panel?.loaded?.();
  }

  choose(step) {
    if (!step || step === this.step) return;
    this.step = step;
    this.drawSteps();
    this.showPanel();
    this.picture.show(step);
    this.panel?.loaded?.();
  }

  leave() {
    this.panel?.leave?.();
    this.left = true;
  }

  async refresh() {
    this.drawSteps();
    await this.picture.load();
    if (this.left) return;
    if (!this.panel?.keeps?.()) this.showPanel(); // what somebody is typing stays
    this.panel?.loaded?.();
  }

  redraw() {
    this.picture.viewer.redraw();
    this.panel?.news?.();
  }

  news(news) {
    const key = JSON.stringify([this.app.job?.state, this.app.job?.step, this.app.job?.folder]);
    if (key !== this.key) {
      this.key = key;
      this.drawSteps();
      this.panel?.jobChanged?.();
      if (this.app.scanningHere && this.step !== "record" && this.app.job.state === "running" && !this.sawScan) this.app.go([this.app.name, "record"]);
      this.sawScan = this.app.scanningHere;
    }
    this.picture.news(news);
    this.panel?.news?.(news);
  }

  showPanel() {
    this.panel?.leave?.();
    this.panel = new panels[this.step](this.app, this);
    fill(this.details, this.panel.element);
    this.picture.show(this.step);
  }

  // ---- the list ----

  drawSteps() {
    const chosen = document.activeElement?.dataset?.step;
    fill(this.list, this.app.overview.steps.map((step) => this.stepCard(step)), this.allButton());
    if (chosen) this.list.querySelector(`[data-step="${chosen}"]`)?.focus();
  }

  state(step) {
    const job = this.app.job;
    const here = job && job.folder.split("/").pop() === this.app.name && job.step === RUNS[step.name];
    if (here && job.active) return "running";
    if (here && ["failed", "stopped"].includes(job.state) && step.state !== "done") return job.state;
    return step.state;
  }

  stepCard(step) {
    const state = this.state(step);
    const sign = h("span", { class: `sign ${state === "running" ? "turning" : ""}`, "aria-hidden": "true" }, SIGNS[state]);
    const pick = h(
      "button",
      { type: "button", class: "pick", "data-step": step.name, "aria-current": step.name === this.step ? "step" : null, onclick: () => this.app.go([this.app.name, step.name]) },
      sign,
      h("span", {}, step.title, h("span", { class: "quiet" }, ` · ${WORDS[state]}`)),
      step.figure ? h("span", { class: "figure" }, step.figure) : null,
      state === "stale" ? h("span", { class: "figure" }, step.why) : null,
    );
    const main = step.name === this.step && this.app.mayAct ? h("div", { class: "do" }, this.mainButton(step, state)) : null;
    return h("div", { class: `step ${state} ${step.name === this.step ? "chosen" : ""}` }, pick, main);
  }

  mainButton(step, state) {
    const options = { kind: "main", id: `do-${step.name}` };
    if (step.name === "record" && state === "done") return this.app.stepButton("Every point is read", ["record"], { ...options, disabled: true });
    const resumes = step.name === "record" && ["partial", "stopped", "failed"].includes(state);
    const again = ["done", "stale"].includes(state) && step.name !== "record" ? " again" : "";
    const label = resumes ? "Go on with the scan" : LABELS[step.name] + again;
    const asks = step.name === "views" && state === "done" ? "This replaces the views. Press again" : "";
    return this.app.stepButton(label, [RUNS[step.name]], { ...options, asks });
  }

  // Everything that is missing up to the plan, or all after the scan: never motion without its own button.
  allButton() {
    if (!this.app.mayAct) return null;
    const of = (names) => this.app.overview.steps.filter((s) => names.includes(s.name) && ["missing", "stale"].includes(s.state)).map((s) => s.name);
    const before = of(["views", "surface", "plan"]);
    const after = of(["cscan", "report"]);
    const scanned = this.app.overview.steps.find((s) => s.name === "record").state === "done";
    const steps = before.length ? before : scanned ? after : [];
    if (steps.length < 2) return null;
    const button = this.app.stepButton(before.length ? "Do all up to the plan" : "Do all up to the report", steps, { id: "do-all" });
    return button;
  }
}

