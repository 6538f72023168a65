// All inspections: search, open, copy a technique, go on with an interrupted scan, begin a new one.

import { ask } from "./api.js";
import { button, empty, fill, h } from "./dom.js";

const STATES = ["new", "views taken", "surface made", "planned", "interrupted", "scanned", "analysed", "reported", "damaged"];

export class Shelf {
  constructor(app) {
    this.app = app;
    this.body = h("div", {});
    this.words = h("input", { type: "search", placeholder: "search name or part", "aria-label": "search name or part", id: "search", oninput: () => this.draw() });
    this.part = h("select", { "aria-label": "part", onchange: () => this.draw() });
    this.state = h("select", { "aria-label": "state", onchange: () => this.draw() }, h("option", { value: "" }, "every state"), STATES.map((state) => h("option", {}, state)));
    this.since = h("input", { type: "date", "aria-label": "since", title: "since", onchange: () => this.draw() });
    this.newPlace = h("div", {});
    this.element = h("div", { class: "shelf" }, this.newPlace, h("div", { class: "filters" }, this.words, this.part, this.state, this.since), this.body);
    this.refresh().catch((fault) => fill(this.body, empty("The list cannot be read", fault.message)));
  }

  async refresh() {
    const { inspections, parts, root } = await ask("list");
    this.inspections = inspections;
    if (!this.made && this.app.mayAct) this.drawNew(parts, root);
    const chosen = this.part.value;
    fill(this.part, h("option", { value: "" }, "every part"), [...new Set(inspections.map((entry) => entry.part))].sort().map((part) => h("option", {}, part)));
    this.part.value = chosen;
    this.draw();
  }

  drawNew(parts, root) {
    this.made = true;
    const today = new Date().toISOString().slice(0, 10);
    const part = h("select", { id: "new-part" }, parts.map((name) => h("option", {}, name)));
    const name = h("input", { id: "new-name", value: `${today}-${parts[0]}`, autocomplete: "off" });
    const seed = h("input", { id: "new-seed", type: "number", min: "0", value: "1" });
    part.onchange = () => {
      if (/^\d{4}-\d\d-\d\d-/.test(name.value)) name.value = `${today}-${part.value}`;
    };
    const make = button("New inspection", async () => {
      const { name: made } = await ask("make", { new: name.value.trim(), part: part.value, seed: Number(seed.value) });
      this.app.go([made, "views"]);
    }, { kind: "main", id: "new" });
    fill(this.newPlace, h("div", { class: "card" }, h("h2", {}, "New inspection"), h("div", { class: "new" }, h("label", {}, "Name", name), h("label", {}, "Part", part), h("label", {}, "Seed of the virtual cell", seed), make), h("p", { class: "quiet" }, `kept in ${root}`)));
  }

  draw() {
    if (!this.inspections) return undefined;
    const words = this.words.value.trim().toLowerCase();
    const fits = (entry) =>
      (!words || `${entry.name} ${entry.part} ${entry.serial}`.toLowerCase().includes(words)) &&
      (!this.part.value || entry.part === this.part.value) &&
      (!this.state.value || entry.state === this.state.value) &&
      (!this.since.value || entry.date.slice(0, 10) >= this.since.value);
    const rows = this.inspections.filter(fits).map((entry) => this.rowOf(entry));
    if (!this.inspections.length) return fill(this.body, empty("No inspection yet", "Make the first one above."));
    if (!rows.length) return fill(this.body, empty("Nothing fits", "No inspection fits this search. Clear a filter."));
    const heads = ["Inspection", "Part", "Last change", "State", ""];
    return fill(this.body, h("div", { class: "card" }, h("table", {}, h("thead", {}, h("tr", {}, heads.map((head) => h("th", { scope: "col" }, head)))), h("tbody", {}, rows))));
  }

  rowOf(entry) {
    const resume = entry.state === "interrupted";
    const open = button(resume ? "Go on" : "Open", () => this.app.go(resume ? [entry.name, "record"] : [entry.name]), { kind: "small", disabled: entry.state === "damaged" });
    const copy = this.app.mayAct && !entry.fault ? button("Copy technique", () => this.copy(entry), { kind: "small" }) : null;
    const state = entry.fault ? h("span", { class: "fault" }, entry.fault) : entry.state;
    return h("tr", {}, [h("strong", {}, entry.name), `${entry.part} ${entry.serial}`, entry.date.replace("T", " ").slice(0, 16), state, h("div", { class: "row" }, open, copy)].map((cell) => h("td", {}, cell)));
  }

  async copy(entry) {
    const today = new Date().toISOString().slice(0, 10);
    const taken = new Set(this.inspections.map((other) => other.name));
    let name = `${today}-${entry.part}`;
    for (let k = 2; taken.has(name); k++) name = `${today}-${entry.part}-${k}`;
    await ask("duplicate", { name: entry.name, new: name });
    this.app.go([name, "plan"]);
  }
}
