// The technique as a form: unit and limits beside every value, checked as it is typed.

import { ask } from "./api.js";
import { button, empty, fill, h, say } from "./dom.js";

const TITLES = {
  procedure: "Procedure and people",
  part: "Part",
  surface: "Surface",
  probe: "Probe",
  drive: "Frequency and level",
  plan: "Rows and points",
  scan: "Motion and lift-off",
  analysis: "Calls",
};
const CHECK_AFTER_MS = 250;

export class Form {
  constructor(app, open = ["plan", "scan"]) {
    this.app = app;
    this.open = open;
    this.changes = {};
    this.fields = {};
    this.element = h("div", { class: "card form" }, h("h3", {}, "Technique"), h("p", { class: "quiet" }, "loading …"));
    this.load().catch((fault) => fill(this.element, empty("The technique cannot be read", fault.message)));
  }

  async load() {
    const { sections } = await ask("form", { name: this.app.name });
    const order = [...this.open, ...sections.map((s) => s.section).filter((name) => !this.open.includes(name))];
    const parts = order.map((name) => this.section(sections.find((s) => s.section === name)));
    this.save = button("Save technique", () => this.send(), { kind: "main", id: "save-technique", disabled: true });
    this.note = h("span", { class: "quiet", role: "status" });
    fill(this.element, h("h3", {}, "Technique"), parts, this.app.mayAct ? h("div", { class: "row" }, this.save, this.note) : null);
  }

  section({ section, about, fields }) {
    const rows = fields.filter((field) => field.kind !== "other").map((field) => this.field(section, field));
    return h("details", { open: this.open.includes(section) }, h("summary", {}, TITLES[section] || section), h("p", { class: "quiet" }, about), rows);
  }

  field(section, field) {
    const id = `${section}.${field.key}`;
    const input = this.input(field, id);
    input.disabled = !this.app.mayAct;
    const wrong = h("span", { class: "wrong", role: "alert", hidden: true });
    const hints = [field.about, field.limits].filter(Boolean).join("; ");
    const label = h("label", { for: id }, field.key.replace(/_(mm_s|ms_m|mm|deg|hz|s|v)$/, "").replaceAll("_", " "), hints ? h("span", { class: "about" }, hints) : null);
    input.oninput = () => this.typed(section, field, input);
    this.fields[id] = { input, wrong };
    return h("div", { class: "field" }, label, input, h("span", { class: "unit" }, field.unit), wrong);
  }

  input(field, id) {
    if (field.kind === "choice") return h("select", { id }, field.choices.map((choice) => h("option", { selected: choice === field.value }, choice)));
    if (field.kind === "switch") return h("input", { id, type: "checkbox", checked: field.value });
    return h("input", { id, type: "text", inputmode: field.kind === "number" ? "decimal" : "text", value: field.value === null ? "" : String(field.value), autocomplete: "off" });
  }

  typed(section, field, input) {
    let value = input.value;
    if (field.kind === "switch") value = input.checked;
    else if (field.kind === "number") value = input.value.trim() === "" || Number.isNaN(Number(input.value.replace(",", "."))) ? input.value : Number(input.value.replace(",", "."));
    else if (value === "" && field.value === null) value = null;
    this.changes[section] = { ...this.changes[section], [field.key]: value };
    this.save.disabled = true;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check(), CHECK_AFTER_MS);
  }

  async check() {
    const asked = JSON.stringify(this.changes);
    const { faults } = await ask("check", { name: this.app.name, changes: this.changes });
    if (asked !== JSON.stringify(this.changes)) return;
    for (const [id, { input, wrong }] of Object.entries(this.fields)) {
      input.setAttribute("aria-invalid", String(id in faults));
      wrong.hidden = !(id in faults);
      wrong.textContent = faults[id] || "";
    }
    const others = Object.entries(faults).filter(([id]) => !(id in this.fields)).map(([id, words]) => `${id}: ${words}`);
    fill(this.note, others.join("; ") || (Object.keys(faults).length ? "A value does not hold." : "Not saved yet."));
    this.save.disabled = Object.keys(faults).length > 0;
  }

  async send() {
    const { changed } = await ask("save", { name: this.app.name, changes: this.changes });
    const count = Object.keys(changed).length;
    say(count ? `Saved: ${Object.keys(changed).join(", ")}. Steps that used the old values are out of date now.` : "Nothing changed.");
    this.changes = {};
    this.save.disabled = true;
    fill(this.note, "");
  }

  get edited() {
    return Object.keys(this.changes).length > 0;
  }
}
