// What is drawn over the picture: marks of lights, and handles that drag what is selected.
const COLORS = ["#ee7a6d", "#8fce7f", "#6fa8f0"];
const HANDLE = 70; // CSS pixels
const NEAR = 9;

export class Overlay {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.about = null;
    this.rect = { x: 0, y: 0, width: 1, height: 1 }; // of the picture, in CSS pixels of the canvas
    this.drag = null;
    this.hover = null;
  }

  // CSS pixels and depth of a point in the world; null where it is behind the eye.
  project(p) {
    const m = this.about.clip, row = (k) => m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3];
    const w = row(3);
    if (w <= 1e-9) return null;
    const { x, y, width, height } = this.rect;
    return [x + (0.5 + 0.5 * row(0) / w) * width, y + (0.5 - 0.5 * row(1) / w) * height, w];
  }

  place() {
    const handle = this.about && this.about.handle;
    return handle && (this.drag ? this.drag.place : handle.place);
  }

  // Metres that are HANDLE pixels long at a point.
  length(p) {
    const here = this.project(p);
    if (!here) return 0;
    let longest = 1e-9;
    for (let k = 0; k < 3; k++) {
      const m = this.about.clip, w = here[2];
      longest = Math.max(longest, Math.hypot(m[k] / w * this.rect.width / 2, m[4 + k] / w * this.rect.height / 2));
    }
    return HANDLE / longest;
  }

  // What of the overlay is under a place: an axis 0 to 2, "free", {light}, or null.
  at(x, y) {
    if (!this.about) return null;
    const p = this.place(), base = p && this.project(p);
    if (base) {
      if (Math.hypot(x - base[0], y - base[1]) < NEAR) return "free";
      const length = this.length(p);
      for (let k = 0; k < 3; k++) {
        const q = [...p];
        q[k] += length;
        const tip = this.project(q);
        if (tip && distance(x, y, base, tip) < NEAR - 3) return k;
      }
    }
    for (const [number, a, b, c] of this.about.lights) {
      const at = this.project([a, b, c]);
      if (at && Math.hypot(x - at[0], y - at[1]) < NEAR + 2) return { light: number };
    }
    return null;
  }

  begin(part, x, y) {
    const place = [...this.about.handle.place];
    this.drag = { part, x, y, from: place, place, clip: this.about.clip, node: this.about.handle.node };
  }

  // Where the handle is dragged to, in the world.
  move(x, y) {
    const { part, from, clip: m } = this.drag, { width, height } = this.rect;
    const dot = (k, v) => m[4 * k] * v[0] + m[4 * k + 1] * v[1] + m[4 * k + 2] * v[2];
    const at = (k) => dot(k, from) + m[4 * k + 3];
    const dx = 2 * (x - this.drag.x) / width, dy = -2 * (y - this.drag.y) / height;
    const w = at(3);
    if (part === "free") { // in the plane of the picture: x, y and w of the clip space are known, or z for parallel rays
      const kept = m[12] || m[13] || m[14] ? 3 : 2;
      const step = solve([0, 1, kept].map((k) => [m[4 * k], m[4 * k + 1], m[4 * k + 2]]), [dx * w, dy * w, 0]);
      if (step) this.drag.place = from.map((v, k) => v + step[k]);
      return this.drag.place;
    }
    // along an axis the place in the picture is (a + t b) / (c + t d) in the direction of the axis
    const axis = [0, 0, 0];
    axis[part] = 1;
    const u = [at(0) / w, at(1) / w];
    const along = [dot(0, axis) - u[0] * dot(3, axis), dot(1, axis) - u[1] * dot(3, axis)].map((v, k) => v * [width, height][k]);
    const size = Math.hypot(...along);
    if (size < 1e-9) return this.drag.place;
    const d = [along[0] / size * width, along[1] / size * height];
    const goal = (u[0] + dx) * d[0] + (u[1] + dy) * d[1];
    const a = at(0) * d[0] + at(1) * d[1], b = dot(0, axis) * d[0] + dot(1, axis) * d[1];
    const t = (goal * w - a) / (b - goal * dot(3, axis));
    if (Number.isFinite(t) && w + t * dot(3, axis) > 1e-6 * w) this.drag.place = from.map((v, k) => v + t * axis[k]);
    return this.drag.place;
  }

  draw() {
    const { canvas, context: c } = this, ratio = devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    if (!this.about) return;
    const chosen = this.about.handle && this.about.handle.node;
    for (const [number, a, b, d, kind] of this.about.lights) {
      const p = this.project(number === chosen && this.drag ? this.drag.place : [a, b, d]);
      if (p) this.mark(p, kind, number === chosen || (this.hover && this.hover.light === number));
    }
    if (this.inspector) this.inspector.draw();
    this.handles();
  }

  mark([x, y], kind, bright) {
    const c = this.context;
    for (const [color, width] of [["#000a", 4], [bright ? "#ffd79a" : "#e9b872", 1.6]]) {
      c.strokeStyle = color;
      c.lineWidth = width;
      c.beginPath();
      c.arc(x, y, 4, 0, 7);
      for (let k = 0; k < 8; k++) {
        const s = Math.sin(k * Math.PI / 4), t = Math.cos(k * Math.PI / 4);
        if (kind === "point" || k % 2) { c.moveTo(x + 6.5 * t, y + 6.5 * s); c.lineTo(x + 9 * t, y + 9 * s); }
      }
      c.stroke();
    }
  }

  handles() {
    const p = this.place(), c = this.context, base = p && this.project(p);
    if (!base) return;
    const length = this.length(p);
    const tips = [0, 1, 2].map((k) => this.project(p.map((v, i) => v + (i === k ? length : 0))));
    const order = [0, 1, 2].filter((k) => tips[k]).sort((a, b) => tips[b][2] - tips[a][2]);
    for (const k of order) {
      const on = this.hover === k || (this.drag && this.drag.part === k);
      for (const [color, width] of [["#0009", on ? 6 : 5], [on ? "#fff" : COLORS[k], on ? 3 : 2.2]]) {
        c.strokeStyle = color;
        c.lineWidth = width;
        c.beginPath();
        c.moveTo(base[0], base[1]);
        c.lineTo(tips[k][0], tips[k][1]);
        c.stroke();
      }
      c.fillStyle = on ? "#fff" : COLORS[k];
      c.beginPath();
      c.arc(tips[k][0], tips[k][1], 5, 0, 7);
      c.fill();
    }
    const free = this.hover === "free" || (this.drag && this.drag.part === "free");
    c.fillStyle = free ? "#fff" : "#d8dade";
    c.strokeStyle = "#000b";
    c.lineWidth = 1.5;
    c.beginPath();
    c.rect(base[0] - 4, base[1] - 4, 8, 8);
    c.fill();
    c.stroke();
  }
}

function distance(x, y, a, b) {
  const dx = b[0] - a[0], dy = b[1] - a[1];
  const t = Math.max(0.12, Math.min(1.06, ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(x - a[0] - t * dx, y - a[1] - t * dy);
}

// The solution of three equations, by Cramer's rule; null where there is none.
function solve(rows, right) {
  const det = (m) => m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
    + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  const whole = det(rows);
  if (Math.abs(whole) < 1e-30) return null;
  return [0, 1, 2].map((k) => det(rows.map((row, i) => row.map((v, j) => (j === k ? right[i] : v)))) / whole);
}
