// What pictures cost: milliseconds of the stages, stacked, of the last pictures.
const COLORS = ["#6fa8f0", "#8fce7f", "#c3a6e8", "#e9b872", "#ee7a6d", "#6fcfc8", "#8b9099"];
const MOST = 120;

export class Plot {
  constructor(canvas, legend) {
    this.canvas = canvas;
    this.legend = legend;
    this.history = [];
  }

  add(stages) {
    this.history.push(stages);
    if (this.history.length > MOST) this.history.shift();
    const names = Object.keys(stages);
    if (this.legend.childElementCount !== names.length) {
      const svg = "http://www.w3.org/2000/svg";
      this.legend.replaceChildren(...names.map((name, k) => {
        const item = document.createElement("span"), mark = document.createElementNS(svg, "svg"), dot = document.createElementNS(svg, "rect");
        for (const [key, value] of Object.entries({ width: 8, height: 8, rx: 2, fill: COLORS[k % COLORS.length] })) dot.setAttribute(key, value);
        mark.append(dot);
        item.append(mark, name.replace("_", " "));
        return item;
      }));
    }
    this.draw();
  }

  draw() {
    const { canvas } = this, ratio = devicePixelRatio || 1, c = canvas.getContext("2d");
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !this.history.length) return;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const sums = this.history.map((s) => Object.values(s).reduce((a, b) => a + b, 0));
    const sorted = [...sums].sort((a, b) => a - b), top = 1.25 * Math.max(1, sorted[Math.floor(0.95 * (sorted.length - 1))]);
    const step = width / MOST, x0 = width - step * this.history.length;
    this.history.forEach((stages, i) => {
      let y = height;
      Object.values(stages).forEach((ms, k) => {
        const h = (ms / top) * height;
        c.fillStyle = COLORS[k % COLORS.length];
        c.fillRect(x0 + i * step, y - h, step - (step > 3 ? 0.5 : 0), h);
        y -= h;
      });
    });
    c.fillStyle = "#8b9099";
    c.font = "10px system-ui, sans-serif";
    c.fillText(`${top.toFixed(0)} ms`, 5, 12);
  }
}
