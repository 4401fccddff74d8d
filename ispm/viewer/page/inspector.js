// The photon inspector: the ways of the photons that light a place, drawn into the picture and listed.
import { make } from "./fields.js";

const $ = (id) => document.getElementById(id);
const COLORS = ["#66d0e6", "#f0b04f", "#8fce7f", "#c79bf2", "#f0879f"]; // by bounce; the last for all more
const WIDEST = 3.5; // CSS pixels
const color = (bounce) => COLORS[Math.min(bounce, COLORS.length - 1)];
const short = (v) => (v >= 1e4 || (v < 1e-3 && v > 0) ? v.toExponential(1) : Number(v.toPrecision(3)).toString());

export class Inspector {
  constructor(link, overlay) {
    this.link = link;
    this.overlay = overlay;
    this.on = false;
    this.found = { point: null, paths: [] };
    this.chosen = -1;
    overlay.inspector = this;
    $("inspect").addEventListener("click", () => this.toggle(null));
  }

  // Begin, with the place under the pointer, if it is over the picture; or end.
  toggle(place) {
    this.on = !this.on;
    if (this.on && place) this.at(...place);
    if (!this.on) {
      this.link.send({ type: "inspect" });
      this.found = { point: null, paths: [] };
    }
    this.panel();
    this.overlay.draw();
  }

  at(x, y) { this.link.send({ type: "inspect", x, y }); }

  // What the server tells: the light of a place, or that there is none any more.
  show(found) {
    this.found = found;
    this.chosen = -1;
    this.panel();
    this.overlay.draw();
  }

  panel() {
    const { point, light, photons, paths } = this.found, open = this.on || point !== null;
    $("inspect").setAttribute("aria-pressed", this.on);
    $("overlay").classList.toggle("inspecting", this.on);
    $("inspector").hidden = !open;
    if (!open) return;
    const close = make("button", { class: "icon", textContent: "×", title: "close (I)", "aria-label": "close", onclick: () => { this.on = true; this.toggle(null); } });
    const parts = [make("h2", {}, "Light at a place", close)];
    if (point === null) parts.push(make("p", { class: "quiet", textContent: "Click a place in the picture: the photons that light it are drawn." }));
    else {
      const many = paths.length < photons ? `, the ${paths.length} strongest` : "";
      parts.push(make("p", {}, make("strong", { textContent: `${short(light)} lx` }), ` of indirect light by ${photons.toLocaleString("en")} photon${photons === 1 ? "" : "s"}${many}`));
      if (paths.length) parts.push(this.list(paths));
    }
    $("inspector").replaceChildren(...parts);
  }

  list(paths) {
    const head = make("tr", {}, ...["", "ways", "lm", "lx"].map((textContent) => make("th", { textContent })));
    const choose = (k) => { this.chosen = k; this.overlay.draw(); };
    const rows = paths.map((path, k) => {
      const mark = make("td", { class: "bounce", textContent: path.bounce, title: `${path.bounce} scatter${path.bounce === 1 ? "" : "s"}` });
      mark.style.color = color(path.bounce);
      const way = make("td", { textContent: together(path.events.slice(1, -1)), title: `${path.events.join(" → ")}\nlm: ${path.flux.map(short).join(" → ")}` });
      return make("tr", { tabIndex: 0, onpointerenter: () => choose(k), onpointerleave: () => choose(-1), onfocus: () => choose(k), onblur: () => choose(-1) },
        mark, way, make("td", { textContent: short(path.flux[path.flux.length - 1]) }), make("td", { textContent: short(path.light) }));
    });
    return make("table", { class: "ways" }, make("thead", {}, head), make("tbody", {}, ...rows));
  }

  // Draw the ways over the picture, the weakest first.
  draw() {
    const { overlay, found: { point, paths } } = this, c = overlay.context;
    if (point === null || !overlay.about) return;
    const most = Math.max(...paths.map((path) => path.light), 1e-30), { x, y, width, height } = overlay.rect;
    c.save();
    c.beginPath();
    c.rect(x, y, width, height);
    c.clip();
    c.lineCap = c.lineJoin = "round";
    for (let k = paths.length - 1; k >= 0; k--) if (k !== this.chosen) this.way(paths[k], most, this.chosen < 0 ? 0.7 : 0.13);
    const place = overlay.project(point);
    if (paths[this.chosen]) {
      this.way(paths[this.chosen], most, 1);
      this.reach(paths[this.chosen], place);
    }
    if (place) {
      for (const [style, thick] of [["#000c", 4], ["#fff", 1.8]]) {
        c.strokeStyle = style;
        c.lineWidth = thick;
        c.beginPath();
        c.arc(place[0], place[1], 6, 0, 7);
        c.stroke();
      }
    }
    c.restore();
  }

  // From where a photon is stored to the place that its kernel lights.
  reach(path, place) {
    const c = this.overlay.context, stored = this.overlay.project(path.places[path.places.length - 1]);
    if (!stored || !place) return;
    c.strokeStyle = "#fff";
    c.lineWidth = 1.2;
    c.setLineDash([2, 4]);
    c.beginPath();
    c.moveTo(stored[0], stored[1]);
    c.lineTo(place[0], place[1]);
    c.stroke();
    c.setLineDash([]);
  }

  way(path, most, alpha) {
    const c = this.overlay.context, wide = 1 + (WIDEST - 1) * Math.sqrt(path.light / most), alone = alpha === 1;
    c.globalAlpha = alpha;
    for (const [style, more] of alone ? [["#000b", 2.5], [color(path.bounce), 0.8]] : [[color(path.bounce), 0]]) {
      c.strokeStyle = style;
      c.lineWidth = wide + more;
      c.beginPath();
      for (let k = 1; k < path.places.length; k++) {
        const ends = this.segment(path.places[k - 1], path.places[k]);
        if (ends) { c.moveTo(...ends[0]); c.lineTo(...ends[1]); }
      }
      c.stroke();
    }
    c.fillStyle = alone ? "#fff" : color(path.bounce);
    for (const place of path.places.slice(1, -1)) {
      const p = this.overlay.project(place);
      if (!p) continue;
      c.beginPath();
      c.arc(p[0], p[1], alone ? 3.2 : 0.6 * wide + 1.2, 0, 7);
      c.fill();
    }
    c.globalAlpha = 1;
  }

  // The ends of a line in the picture, as much of it as lies before the eye; null: nothing does.
  segment(a, b) {
    const m = this.overlay.about.clip, depth = (p) => m[12] * p[0] + m[13] * p[1] + m[14] * p[2] + m[15];
    const u = depth(a), v = depth(b), least = 1e-3 * Math.max(Math.abs(u), Math.abs(v), 1e-6);
    if (u < least && v < least) return null;
    const cut = (from, to, w, other) => (w >= least ? from : from.map((value, k) => value + (to[k] - value) * (least - w) / (other - w)));
    const ends = [this.overlay.project(cut(a, b, u, v)), this.overlay.project(cut(b, a, v, u))];
    return ends[0] && ends[1] ? ends.map(([x, y]) => [x, y]) : null;
  }
}

// Words of a way, equal ones in a row counted: "diffuse ×3".
function together(words) {
  const runs = [];
  for (const word of words) {
    if (runs.length && runs[runs.length - 1][0] === word) runs[runs.length - 1][1]++;
    else runs.push([word, 1]);
  }
  return runs.map(([word, n]) => (n > 1 ? `${word} ×${n}` : word)).join(" · ");
}
