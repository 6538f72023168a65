// Views: what the camera saw, how the views fit together; drop files to add some.

import { askArrays, upload } from "./api.js";
import { colours, spread } from "./colours.js";
import { button, empty, fill, h, number, say } from "./dom.js";

export class Views {
  constructor(app) {
    this.app = app;
    this.element = h("div", {}, h("h2", {}, "Views"), this.dropPlace(), h("div", { class: "card" }, this.thumbs()), this.fit());
  }

  dropPlace() {
    if (!this.app.mayAct) return null;
    const input = h("input", { type: "file", multiple: true, hidden: true, accept: ".png,.ply,.pcd,.xyz,.e57,.json", id: "files" });
    this.told = h("div", { class: "quiet", role: "status" });
    const place = h(
      "div",
      { class: "card drop" },
      h("p", {}, "Drop views here: depth .png with its camera.json, .ply, .pcd, .xyz, .e57; poses.json if a robot knows them."),
      button("Choose files", () => input.click()),
      input,
      this.told,
    );
    input.onchange = () => this.send([...input.files]);
    place.addEventListener("dragover", (event) => {
      event.preventDefault();
      place.classList.add("over");
    });
    place.addEventListener("dragleave", () => place.classList.remove("over"));
    place.addEventListener("drop", (event) => {
      event.preventDefault();
      place.classList.remove("over");
      this.send([...event.dataTransfer.files]);
    });
    return place;
  }

  // camera.json and poses.json first: the depth images need them.
  async send(files) {
    files.sort((a, b) => Number(b.name.endsWith(".json")) - Number(a.name.endsWith(".json")));
    for (const [k, file] of files.entries()) {
      fill(this.told, `Sending ${file.name} (${k + 1} of ${files.length}) …`);
      try {
        const { file: kept, renamed } = await upload(this.app.name, file);
        fill(this.told, renamed ? `${file.name} is kept as ${kept}.` : `${kept} is in.`);
      } catch (fault) {
        say(`${file.name}: ${fault.message}`, "error");
      }
    }
  }

  thumbs() {
    const views = this.app.overview.views;
    if (!views.length) return empty("No views yet", "Let the rig's camera take them, or drop files above. Two or more are needed; five around the part are good.");
    const figures = views.map((view) => {
      const canvas = h("canvas", { width: 320, height: 200, role: "img", "aria-label": `depth picture of ${view.name}` });
      const caption = h("figcaption", {}, view.name);
      askArrays("view", { name: this.app.name, view: view.name }).then((seen) => draw(canvas, caption, seen), (fault) => caption.append(h("div", { class: "fault" }, fault.message)));
      return h("figure", {}, canvas, caption);
    });
    return h("div", { class: "thumbs" }, figures);
  }

  fit() {
    const summary = this.app.overview.summaries.surface;
    if (!summary?.views) return h("p", { class: "quiet" }, "How the views fit together shows here once the surface is made.");
    return h("div", { class: "card" }, h("h3", {}, "How the views fit together"), summary.views.map(fitLine));
  }
}

function fitLine(view) {
  const weak = view.weak_directions || [];
  const words = [`${number(view.inlier_rmse_mm, 3)} mm apart where they overlap, ${number(100 * view.fitness, 0)} % overlap`];
  if (view.source && view.source !== "registered") words.push(`pose ${view.source}`);
  return h(
    "div",
    {},
    h("strong", {}, view.file),
    h("div", { class: "quiet" }, words.join("; ")),
    view.converged === false ? h("div", { class: "warning" }, "This view did not settle. Take it again from another side.") : null,
    weak.length ? h("div", { class: "warning" }, `Weak: ${weak.join("; ")}. A view from another direction would hold it.`) : null,
  );
}

// Depth as colour (near is bright), clouds from above.
function draw(canvas, caption, { facts, arrays }) {
  if (facts.kind === "cloud") {
    caption.append(h("div", { class: "quiet" }, `${facts.of} points${facts.dropped ? `, ${facts.dropped} without value left out` : ""}`));
    return drawCloud(canvas, arrays.points);
  }
  const depth = arrays.depth_mm;
  const [rows, width] = depth.shape;
  const finite = depth.filter((value) => Number.isFinite(value));
  const [low, high] = spread(finite, 0.02);
  const rgb = colours(depth.map((value) => -value), -high, -low, "cividis", [12, 12, 16]);
  canvas.width = width;
  canvas.height = rows;
  const c = canvas.getContext("2d");
  const image = c.createImageData(width, rows);
  for (let k = 0; k < rows * width; k++) image.data.set([rgb[3 * k], rgb[3 * k + 1], rgb[3 * k + 2], 255], 4 * k);
  c.putImageData(image, 0, 0);
  caption.append(h("div", { class: "quiet" }, finite.length ? `${number(low, 0)} to ${number(high, 0)} mm, ${number((100 * finite.length) / depth.length, 0)} % seen` : "nothing seen"));
  return undefined;
}

function drawCloud(canvas, points) {
  const c = canvas.getContext("2d");
  const axis = (k) => points.filter((_, i) => i % 3 === k);
  const [xs, ys, zs] = [axis(0), axis(1), axis(2)];
  const [x0, x1] = spread(xs, 0);
  const [y0, y1] = spread(ys, 0);
  const rgb = colours(zs, ...spread(zs, 0.02), "cividis");
  const scale = Math.min(canvas.width / (x1 - x0), canvas.height / (y1 - y0));
  for (let k = 0; k < xs.length; k++) {
    c.fillStyle = `rgb(${rgb[3 * k]},${rgb[3 * k + 1]},${rgb[3 * k + 2]})`;
    c.fillRect((xs[k] - x0) * scale, canvas.height - (ys[k] - y0) * scale, 1.5, 1.5);
  }
}
