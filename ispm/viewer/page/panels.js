// The panels beside the picture: the scene's tree, what is selected, settings, statistics.
import { make, rows } from "./fields.js";

const $ = (id) => document.getElementById(id);
const MARKS = { light: "✦", camera: "◉", object: "◆", group: "▸" };
const count = (n, what) => `${n.toLocaleString("en")} ${what}${n === 1 ? "" : "s"}`;

export class Panels {
  constructor(link) {
    this.link = link;
    this.scene = null;
    this.chosen = null;
    $("filter").addEventListener("input", () => this.tree());
    $("tree").addEventListener("keydown", (event) => this.step(event));
    $("view").addEventListener("change", () => link.send({ type: "show", view: $("view").value }));
    $("up").addEventListener("change", () => link.send({ type: "up", axis: $("up").value }));
    for (const button of $("add").children) button.addEventListener("click", () => link.send({ type: "add", light: button.dataset.light }));
  }

  part(name, value) {
    if (this[`on_${name}`]) this[`on_${name}`](value);
  }

  on_scene(scene) {
    this.scene = scene;
    document.title = `${scene.name || scene.source || "scene"} · ispm`;
    $("name").textContent = scene.name || scene.source || "scene";
    const lights = scene.rows.filter((r) => r[2] === "light").length;
    $("counts").textContent = `${count(scene.triangles, "triangle")}, ${count(lights, "light")}`;
    const home = make("button", { textContent: "Home", title: "as at the beginning (R)", onclick: () => this.link.send({ type: "camera", index: null }) });
    const all = make("button", { textContent: "Frame all", title: "F", onclick: () => this.link.send({ type: "frame" }) });
    $("cameras").replaceChildren(home, all, ...scene.cameras.map((name, index) =>
      make("button", { textContent: name, onclick: () => this.link.send({ type: "camera", index }) })));
    this.tree();
  }

  tree() {
    if (!this.scene) return;
    const wanted = $("filter").value.trim().toLowerCase(), top = $("tree").scrollTop;
    const found = this.scene.rows.filter((r) => !wanted || r[1].toLowerCase().includes(wanted));
    $("tree").replaceChildren(...found.map(([node, name, kind, depth, away]) => {
      const eye = make("button", { class: "eye", textContent: away ? "○" : "●", title: away ? "show" : "hide (H)", tabIndex: -1, onclick: (event) => {
        event.stopPropagation();
        this.link.send({ type: "change", what: "node", node, field: "hidden", value: !away });
      } });
      const element = make("div", { class: `node ${kind}${away ? " away" : ""}${node === this.chosen ? " chosen" : ""}`, role: "treeitem",
        onclick: () => this.link.send({ type: "select", node }),
        ondblclick: () => this.link.send({ type: "frame", node }) },
        make("span", { class: "mark", textContent: MARKS[kind] }), make("span", { class: "label", textContent: name || kind, title: name }), eye);
      element.style.paddingLeft = `${10 + 12 * (wanted ? 0 : Math.min(depth, 8))}px`;
      element.dataset.node = node;
      return element;
    }));
    if (this.scene.more > 0) $("tree").append(make("div", { class: "node quiet", textContent: `  and ${this.scene.more.toLocaleString("en")} more` }));
    $("tree").scrollTop = top;
  }

  step(event) {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    const shown = [...$("tree").querySelectorAll("[data-node]")], at = shown.findIndex((e) => e.classList.contains("chosen"));
    const next = shown[Math.min(Math.max(at + by, 0), shown.length - 1)];
    if (next) this.link.send({ type: "select", node: Number(next.dataset.node) });
  }

  on_selection(selection) {
    this.chosen = selection.node;
    for (const element of $("tree").querySelectorAll("[data-node]")) {
      const on = Number(element.dataset.node) === selection.node;
      if (on && !element.classList.contains("chosen")) element.scrollIntoView({ block: "nearest" });
      element.classList.toggle("chosen", on);
    }
    const box = $("selection"), key = JSON.stringify([selection.node, selection.groups.map((g) => [g.title, g.what])]);
    if (box.shownKey !== key) {
      box.shownKey = key;
      box.replaceChildren(make("h2", { textContent: selection.node === null ? "Nothing selected" : selection.kind }));
      if (selection.node === null) box.append(make("div", { class: "quiet", textContent: "Click something in the picture." }));
      box.shownGroups = selection.groups.map((group) => {
        const element = make("div");
        if (group.what !== "node") box.append(make("div", { class: "part", textContent: group.title }));
        box.append(element);
        return element;
      });
      if (selection.node !== null) box.append(make("div", { class: "actions" },
        make("button", { textContent: "Focus", title: "F", onclick: () => this.link.send({ type: "frame", node: selection.node }) }),
        make("button", { textContent: "Duplicate", title: "Ctrl+D", onclick: () => this.link.send({ type: "duplicate", node: selection.node }) }),
        make("button", { textContent: "Delete", title: "Del", onclick: () => this.link.send({ type: "delete", node: selection.node }) })));
    }
    selection.groups.forEach((group, k) => rows(box.shownGroups[k], group.fields, `${key}${k}`, (field, value, gesture) =>
      this.link.soon(`${group.what}${group.part}${field}`, { type: "change", what: group.what, node: selection.node, part: group.part, field, value, gesture })));
  }

  on_settings(settings) {
    options($("view"), settings.views);
    options($("up"), settings.axes);
    const first = ["preset", "exposure", "tonemap", "photons", "bounces"];
    const order = (f) => (first.includes(f.name) ? first.indexOf(f.name) : first.length);
    const fields = settings.fields.map((f, k) => [order(f), k, f]).sort((a, b) => a[0] - b[0] || a[1] - b[1]).map((each) => each[2]);
    rows($("settings"), fields, "settings", (name, value, gesture) => this.link.soon(`setting${name}`, { type: "setting", name, value, gesture }));
    fields.forEach((f, k) => $("settings").shownRows[k].classList.toggle("changed", JSON.stringify(f.value) !== JSON.stringify(settings.defaults[f.name])));
  }

  on_history(history) {
    for (const [id, label] of [["undo", history.undo], ["redo", history.redo]]) {
      $(id).disabled = !label;
      $(id).title = `${id} ${label}`.trim();
    }
  }

  on_about(about) {
    $("view").value = about.view;
    $("up").value = about.up;
    this.command = about.command;
    this.say(about.line, Boolean(about.line));
  }

  on_line(line) { this.say(line, true); }

  say(line, bad = false) {
    $("line").textContent = line;
    $("line").classList.toggle("bad", bad);
  }

  stats({ size, stats, still }) {
    const of = (n) => n.toLocaleString("en");
    const state = still ? "at rest" : stats.passes > 1 ? `pass ${stats.passes}` : `${stats.fps.toFixed(1)} fps`;
    $("rate").textContent = `${size[0]} × ${size[1]}   ${state}   ${stats.ms.toFixed(0)} ms`;
    const values = [["photons stored", of(stats.photons)], ["emitted", of(stats.emitted)], ["passes", stats.passes],
      ["error estimate", stats.error === null ? "–" : `${(100 * stats.error).toFixed(1)} %`], ["exposure", `${stats.exposure.toFixed(2)} EV`], ["adapter", stats.adapter]];
    $("stats").replaceChildren(...values.flatMap(([name, value]) => [make("dt", { textContent: name }), make("dd", { textContent: value, title: value })]));
  }
}

function options(select, names) {
  if (select.childElementCount !== names.length) select.replaceChildren(...names.map((name) => make("option", { value: name, textContent: name })));
}
