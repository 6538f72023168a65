// The page's heart: which inspection, which step, what is running; everything else draws from here.

import { act, ask, askArrays, Live } from "./api.js";
import { button, duration, fill, h, say, when } from "./dom.js";
import { Readings } from "./readings.js";
import { Shelf } from "./shelf.js";
import { Bench } from "./bench.js";

const given = JSON.parse(document.getElementById("given").textContent);
const at = (id) => document.getElementById(id);

class App {
  constructor() {
    this.given = given;
    this.mayAct = given.role === "operator";
    this.job = null;
    this.revision = null;
    this.readings = new Readings();
    this.scan = -1;
    this.room = null;
    this.theme(localStorage.getItem("theme") || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
    this.badges();
    at("home").onclick = () => this.go("");
    at("theme").onclick = () => this.theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    at("stop").addEventListener("click", () => this.stop());
    at("pause").addEventListener("click", () => this.pauseOrGo());
    addEventListener("keydown", (event) => this.key(event), true);
    addEventListener("hashchange", () => this.route());
    this.live = new Live((news) => this.news(news), (open) => this.wire(open));
    if (given.start && !location.hash) history.replaceState(null, "", `#/${encodeURIComponent(given.start)}`);
    this.route();
  }

  // ---- where we are ----

  go(path) {
    location.hash = path ? `#/${path.map(encodeURIComponent).join("/")}` : "#/";
  }

  async route() {
    const [name, step] = location.hash.replace(/^#\/?/, "").split("/").map(decodeURIComponent);
    try {
      if (!name) this.enter(new Shelf(this), "Inspections");
      else if (this.name === name && this.room instanceof Bench) this.room.choose(step);
      else await this.openInspection(name, step);
    } catch (fault) {
      say(fault.message, "error");
      if (name) this.go("");
    }
  }

  async openInspection(name, step) {
    const overview = await ask("overview", { name });
    this.overview = overview;
    this.readings = new Readings();
    this.enter(new Bench(this, step), `${name} · ${overview.part}`, name);
    await this.room.load();
  }

  enter(room, title, name = "") {
    this.room?.leave?.();
    this.room = room;
    this.name = name;
    at("title").textContent = title;
    document.title = title ? `${title} – eddyscan` : "eddyscan";
    fill(at("main"), room.element);
    this.badges();
  }

  async refresh() {
    if (!this.name) return this.room?.refresh?.();
    const name = this.name;
    const overview = await ask("overview", { name });
    if (this.name !== name) return undefined;
    this.overview = overview;
    return this.room.refresh();
  }

  // ---- what runs ----

  get running() {
    return Boolean(this.job && this.job.active);
  }

  get runningHere() {
    return this.running && this.job.folder.split("/").pop() === this.name;
  }

  get scanningHere() {
    return this.runningHere && this.job.step === "record";
  }

  async run(steps) {
    await act("run", { name: this.name, steps });
  }

  stop() {
    at("stop").classList.add("pressed");
    setTimeout(() => at("stop").classList.remove("pressed"), 400);
    this.live.stop().catch((fault) => this.alarm(`${fault.message} USE THE EMERGENCY STOP.`));
    if (!this.running) say("Stop sent; nothing was moving.");
  }

  pauseOrGo() {
    if (!this.mayAct || !this.running || this.job.step !== "record") return;
    this.live.command(this.job.state === "paused" ? "resume" : "pause").catch((fault) => say(fault.message, "error"));
  }

  key(event) {
    if (event.key === "Escape") {
      event.preventDefault();
      this.stop();
    } else if (event.key.toLowerCase() === "p" && !event.target.matches("input, textarea, select") && !event.ctrlKey && !event.metaKey) {
      this.pauseOrGo();
    }
  }

  news(news) {
    if (news.fault) {
      say(news.fault, "error");
      return;
    }
    const before = this.job;
    this.job = news.job;
    this.follow(news);
    this.log(news.log);
    this.progress(news);
    this.alarm(news.stop_unanswered_s > 1 ? "No answer to Stop from the rig. USE THE EMERGENCY STOP." : "");
    this.pages = news.pages;
    if (this.revision !== null && this.revision !== news.revision) this.refresh().catch((fault) => say(fault.message, "error"));
    this.revision = news.revision;
    if (before && before.active && this.job && !this.job.active && this.job.state === "failed" && this.room?.step !== "record") say(this.job.message, "error");
    this.room?.news?.(news);
  }

  follow(news) {
    const mine = this.job && this.job.folder.split("/").pop() === this.name;
    if (this.scan !== news.scan && news.anew && mine && this.scan !== -1) this.readings = new Readings();
    this.scan = news.scan;
    if (news.readings.length && mine) this.readings.add(news.readings);
  }

  // ---- what the frame shows ----

  wire(open) {
    at("wire").className = open ? "" : "lost";
    at("wire").textContent = open ? "● connected" : "✕ no connection; trying again";
    if (open && this.revision !== null) this.refresh().catch(() => {});
  }

  badges() {
    const badges = [];
    if (!this.mayAct) badges.push(h("span", { class: "badge" }, "READ-ONLY"));
    if (given.rig) badges.push(h("span", { class: "badge armed", title: given.rig }, "REAL RIG, ARMED"));
    else if (this.name) badges.push(h("span", { class: "badge" }, this.overview?.virtual ? "VIRTUAL CELL" : "REAL RIG, NOT ARMED"));
    fill(at("badges"), badges);
  }

  theme(name) {
    document.documentElement.dataset.theme = name;
    localStorage.setItem("theme", name);
    this.room?.redraw?.();
  }

  alarm(text) {
    at("alarm").hidden = !text;
    at("alarm").textContent = text;
  }

  log(entries) {
    for (const entry of entries) {
      at("lines").prepend(h("li", { class: `line ${entry.level}` }, `${when(entry.time)}  ${entry.message}`));
      at("last").textContent = `${when(entry.time)}  ${entry.message}`;
    }
    while (at("lines").children.length > 300) at("lines").lastChild.remove();
  }

  progress(news) {
    const job = this.job;
    const scanning = job && job.active && job.step === "record";
    at("pause").hidden = !(scanning && this.mayAct);
    at("pause").firstChild.textContent = job && job.state === "paused" ? "Go on " : "Pause ";
    if (!job || (!job.active && job.state === "done")) {
      fill(at("progress"), h("span", {}, job ? `${job.title}: done` : "Ready"));
      return;
    }
    const share = job.total > 0 ? Math.min(1, job.done / job.total) : 0;
    if (!this.bar) this.bar = { words: h("span"), fill: h("div"), left: h("span") };
    this.bar.fill.style.width = `${100 * share}%`;
    const states = { running: "", paused: " – PAUSED", stopping: " – STOPPING", stopped: " – stopped", failed: " – failed" };
    const count = job.total > 1 && Number.isInteger(job.total) ? ` ${Math.round(job.done)} of ${job.total}` : "";
    this.bar.words.textContent = `${job.title}${job.active && job.what ? `: ${job.what === "scan" ? "" : job.what}${count}` : ""}${states[job.state] || ""}`;
    const stopped = news.stop_ms !== null && !job.active ? `stage confirmed Stop after ${news.stop_ms.toFixed(0)} ms` : "";
    this.bar.left.textContent = stopped || (job.active && job.seconds_left !== null ? `${duration(job.seconds_left)} left` : "");
    if (!this.bar.words.isConnected) fill(at("progress"), this.bar.words, h("div", { class: "track" }, this.bar.fill), this.bar.left);
  }

  // ---- for the rooms ----

  scene(scene, name = this.name) {
    return askArrays("scene", { name, scene });
  }

  // A button that starts steps; disabled while anything runs or when looking only.
  stepButton(label, steps, options = {}) {
    return button(label, () => this.run(steps), { ...options, disabled: options.disabled || this.running || !this.mayAct });
  }
}

window.eddyscan = new App();
