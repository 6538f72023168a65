"use strict";
(() => {
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  const themed = (layout) => {
    const axis = { gridcolor: colour("--rule"), zerolinecolor: colour("--rule"), color: colour("--muted") };
    const scene = { ...layout.scene };
    for (const key of ["xaxis", "yaxis", "zaxis"]) scene[key] = { ...scene[key], ...axis };
    const updatemenus = (layout.updatemenus || []).map((menu) => ({
      ...menu, bgcolor: colour("--paper"), bordercolor: colour("--rule"), font: { color: colour("--ink"), size: 13 },
    }));
    return { ...layout, scene, updatemenus, font: { color: colour("--muted"), family: colour("--face"), size: 12 } };
  };

  const shows3d = () => {
    const gl = document.createElement("canvas").getContext("webgl");
    return Boolean(gl && window.Plotly);
  };

  for (const figure of document.querySelectorAll("figure.scene")) {
    if (!shows3d()) break;
    const live = figure.querySelector(".live");
    const { data, layout } = JSON.parse(figure.querySelector(".scene-data").textContent);
    const options = { responsive: true, displaylogo: false, scrollZoom: true, modeBarButtonsToRemove: ["toImage"] };
    live.hidden = false;
    figure.querySelector(".still").style.display = "none";
    window.Plotly.newPlot(live, data, themed(layout), options);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      window.Plotly.react(live, data, themed(layout), options);
    });
  }

  const links = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      for (const link of links.values()) link.classList.remove("here");
      links.get(entry.target.id)?.classList.add("here");
    }
  }, { rootMargin: "-10% 0px -80% 0px" });
  for (const section of document.querySelectorAll("main section")) watcher.observe(section);
})();
