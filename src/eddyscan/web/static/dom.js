// Small building blocks of the page: elements, numbers with units, short messages.

export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else if (name in element && name !== "list" && typeof value !== "string") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export function fill(element, ...children) {
  element.replaceChildren(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export function number(value, digits = 2, unit = "") {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return `${value.toFixed(digits)}${unit ? " " + unit : ""}`;
}

// A number with three meaningful digits and the unit's prefix.
export function ohms(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1 || size === 0) return `${value.toPrecision(3)} Ω`;
  return size >= 1e-3 ? `${(1e3 * value).toPrecision(3)} mΩ` : `${(1e6 * value).toPrecision(3)} µΩ`;
}

export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

export function when(seconds) {
  return new Date(seconds * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit" });
}

// A button that cannot be pressed twice while its work is under way; faults are shown, not swallowed.
export function button(label, work, options = {}) {
  const element = h("button", { type: "button", class: options.kind || "", title: options.title, id: options.id }, label);
  element.disabled = Boolean(options.disabled);
  element.addEventListener("click", async () => {
    if (element.dataset.busy) return;
    if (options.asks && element.textContent !== options.asks) {
      element.textContent = options.asks;
      setTimeout(() => (element.textContent = label), 4000);
      return;
    }
    element.dataset.busy = "yes";
    element.setAttribute("aria-busy", "true");
    try {
      await work(element);
    } catch (fault) {
      say(fault.message || String(fault), "error");
    } finally {
      delete element.dataset.busy;
      element.removeAttribute("aria-busy");
    }
  });
  return element;
}

// A message at the bottom of the page; errors stay until they are closed.
export function say(message, level = "info") {
  const place = document.getElementById("messages");
  for (const other of [...place.children]) if (other.dataset.text === message) other.remove();
  const note = h("div", { "data-text": message, class: `message ${level}`, role: level === "error" ? "alert" : "status" }, h("p", {}, message));
  note.append(h("button", { type: "button", class: "plain", "aria-label": "close message", onclick: () => note.remove() }, "✕"));
  while (place.children.length > 3) place.firstChild.remove();
  place.append(note);
  if (level !== "error") setTimeout(() => note.remove(), 6000);
}

export function empty(title, text, ...more) {
  return h("div", { class: "empty" }, h("h3", {}, title), h("p", {}, text), ...more);
}

export function table(heads, rows, options = {}) {
  return h(
    "table",
    { class: options.class || "" },
    h("thead", {}, h("tr", {}, heads.map((head) => h("th", { scope: "col" }, head)))),
    h("tbody", {}, rows.map((row) => h("tr", {}, row.map((cell) => h("td", {}, cell))))),
  );
}
