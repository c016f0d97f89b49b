// Draws the curves of the report with uPlot: zoom and pan, values under the cursor, panels linked in time.
(() => {
  "use strict";
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const numbers = (text, Kind) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return Array.from(new Kind(bytes.buffer), (v) => (Number.isNaN(v) ? null : v));
  };
  const strokes = {
    measured: { width: 4 }, before: { width: 1.5, dash: [6, 4] }, after: { width: 1.5 }, extended: { width: 1.5 },
    input: { width: 1.5 },
  };

  function options(panel, start, width, last, linked) {
    const axis = { stroke: colour("soft"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") } };
    const input = panel.curves[0].role === "input";
    return {
      width, height: (input ? 96 : 190) + (last ? 26 : 0), title: "", legend: { show: !input, live: true },
      scales: { x: { time: false } },
      axes: [
        { ...axis, size: last ? 30 : 8, values: last ? undefined : () => [], label: last ? "time in s" : undefined, labelSize: 18 },
        { ...axis, size: 62, label: panel.label, labelSize: 20 },
      ],
      series: [
        { label: "t in s", value: (_, v) => (v === null ? "–" : v.toFixed(4)) },
        ...panel.curves.map((c) => ({
          label: c.name, stroke: colour(c.role), ...strokes[c.role], points: { show: false },
          value: (_, v) => (v === null ? "–" : v.toPrecision(5)),
        })),
      ],
      cursor: { sync: { key: linked.key }, drag: { x: true, y: false } },
      hooks: {
        setScale: [(u, key) => key === "x" && linked.follow(u)],
        drawClear: [(u) => {
          const x = u.valToPos(start, "x", true);
          if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) return;
          u.ctx.save();
          u.ctx.strokeStyle = colour("soft");
          u.ctx.setLineDash([3, 3]);
          u.ctx.beginPath();
          u.ctx.moveTo(x, u.bbox.top);
          u.ctx.lineTo(x, u.bbox.top + u.bbox.height);
          u.ctx.stroke();
          u.ctx.restore();
        }],
      },
    };
  }

  function draw(figure, chart) {
    const place = figure.querySelector(".plot");
    place.textContent = "";
    const panels = chart.panels;
    const whole = [panels[0].data[0][0], panels[0].data[0].at(-1)];
    const linked = {
      key: figure.id, plots: [], busy: false,
      follow(from) {
        if (this.busy) return;
        this.busy = true;
        const { min, max } = from.scales.x;
        for (const u of this.plots) if (u !== from) u.setScale("x", { min, max });
        this.busy = false;
      },
      range() { const { min, max } = this.plots[0].scales.x; return [min, max]; },
      show(low, high) {
        const least = (whole[1] - whole[0]) / 1e4;
        const span = Math.min(Math.max(high - low, least), whole[1] - whole[0]);
        const min = Math.min(Math.max(low, whole[0]), whole[1] - span);
        this.plots[0].setScale("x", { min, max: min + span });
      },
      zoom(factor) { const [a, b] = this.range(), m = (a + b) / 2, h = ((b - a) / 2) * factor; this.show(m - h, m + h); },
      move(share) { const [a, b] = this.range(), d = (b - a) * share; this.show(a + d, b + d); },
    };
    const actions = [
      ["−", "zoom out", () => linked.zoom(2)], ["+", "zoom in", () => linked.zoom(0.5)],
      ["◀", "earlier", () => linked.move(-0.25)], ["▶", "later", () => linked.move(0.25)],
      ["whole record", "show the whole record", () => linked.show(...whole)],
    ];
    const bar = document.createElement("div");
    bar.className = "bar";
    for (const [text, label, act] of actions) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      button.setAttribute("aria-label", label);
      button.addEventListener("click", act);
      bar.append(button);
    }
    place.append(bar);
    panels.forEach((panel, n) => {
      const holder = document.createElement("div");
      holder.setAttribute("role", "img");
      holder.setAttribute("aria-label", `${panel.label}: ${panel.curves.map((c) => c.name).join(", ")}`);
      place.append(holder);
      const made = options(panel, chart.start, place.clientWidth, n === panels.length - 1, linked);
      linked.plots.push(new uPlot(made, panel.data, holder));
    });
    return linked;
  }

  function begin() {
    for (const figure of document.querySelectorAll("figure.chart")) {
      const chart = JSON.parse(figure.querySelector("script").textContent);
      for (const panel of chart.panels) {
        panel.data = [numbers(panel.time, Float64Array), ...panel.curves.map((c) => numbers(c.values, Float32Array))];
      }
      figure.classList.add("live");
      let linked = draw(figure, chart);
      let width = figure.clientWidth;
      new ResizeObserver(() => {
        if (figure.clientWidth === width || figure.clientWidth === 0) return;
        width = figure.clientWidth;
        for (const u of linked.plots) u.setSize({ width, height: u.height });
      }).observe(figure);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
        const range = linked.range();
        linked = draw(figure, chart);
        linked.show(...range);
      });
    }
  }
  begin();
})();
