// The page: the picture, what drags and keys do, and the wiring of the rest.
import { gesture } from "./fields.js";
import { Inspector } from "./inspector.js";
import { Link } from "./link.js";
import { Overlay } from "./overlay.js";
import { Panels } from "./panels.js";
import { Plot } from "./plot.js";
import { TimeLine } from "./timeline.js";

const $ = (id) => document.getElementById(id);
const KEYS = [["drag", "orbit"], ["Shift drag, middle drag", "pan"], ["right drag", "look around; with W A S D Q E fly"], ["wheel", "zoom"],
  ["arrows, PgUp, PgDn", "fly"], ["click", "select"], ["double click", "focus there"], ["F", "frame what is selected, or all"], ["R", "camera as at the beginning"],
  ["Del, Ctrl+D, H", "delete, duplicate, hide"], ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["I, then click", "the photons that light a place"], ["Space", "play or pause"], ["1 to 9", "views"],
  ["S", "save the picture"], ["C", "copy the command"], ["[ and ]", "fold the panels"], ["?", "this"]];
const FLY = { ArrowRight: [1, 0, 0], ArrowLeft: [-1, 0, 0], PageUp: [0, 1, 0], PageDown: [0, -1, 0], ArrowUp: [0, 0, 1], ArrowDown: [0, 0, -1] };
const FLY_HELD = { d: [1, 0, 0], a: [-1, 0, 0], e: [0, 1, 0], q: [0, -1, 0], w: [0, 0, 1], s: [0, 0, -1] };

const picture = $("picture"), stage = $("stage"), overlay = new Overlay($("overlay"));
const plot = new Plot($("plot"), $("legend"));
const link = new Link({
  open() { asked = ""; ask(); panels.say(""); },
  close(reason) { panels.say(reason, true); },
  part(name, value) { panels.part(name, value); if (name === "time") timeline.show(value); if (name === "inspected") inspector.show(value); },
  picture(about, bitmap) {
    if (picture.width !== bitmap.width || picture.height !== bitmap.height) { picture.width = bitmap.width; picture.height = bitmap.height; }
    picture.getContext("2d").drawImage(bitmap, 0, 0);
    bitmap.close();
    picture.dataset.number = about.number;
    picture.dataset.still = about.still;
    $("wait").hidden = true;
    overlay.about = about;
    fit();
    overlay.draw();
    if (!about.still) plot.add(about.stats.stages);
    panels.stats(about);
    timeline.at(about.time);
    picture.dispatchEvent(new CustomEvent("shown", { detail: about })); // for those who measure
  },
});
const panels = new Panels(link), timeline = new TimeLine(link), inspector = new Inspector(link, overlay);

// -- the picture's place and size ---------------------------------------------------------------------------

let asked = "", asking = 0;
function fit() {
  const { clientWidth: w, clientHeight: h } = stage;
  const [wide, high] = overlay.about ? overlay.about.full : [picture.width, picture.height];
  const aspect = wide / high; // not the picture's own: a small one's is rounded
  const width = Math.min(w, h * aspect), height = width / aspect;
  const rect = { x: (w - width) / 2, y: (h - height) / 2, width, height };
  Object.assign(picture.style, { left: `${rect.x}px`, top: `${rect.y}px`, width: `${width}px`, height: `${height}px` });
  overlay.rect = rect;
}
function ask() {
  const size = `${stage.clientWidth}x${stage.clientHeight}`;
  if (size === asked || !stage.clientWidth) return;
  asked = size;
  link.send({ type: "resize", width: stage.clientWidth, height: stage.clientHeight });
}
new ResizeObserver(() => { fit(); overlay.draw(); plot.draw(); clearTimeout(asking); asking = setTimeout(ask, 150); }).observe(stage);

// -- the mouse -----------------------------------------------------------------------------------------------

const surface = $("overlay");
let drag = null;
const sum = (...names) => (a, b) => ({ ...b, ...Object.fromEntries(names.map((n) => [n, a[n] + b[n]])) });
const part = (event) => {
  const box = surface.getBoundingClientRect(), r = overlay.rect;
  return [(event.clientX - box.x - r.x) / r.width, (event.clientY - box.y - r.y) / r.height];
};
const local = (event) => { const box = surface.getBoundingClientRect(); return [event.clientX - box.x, event.clientY - box.y]; };

surface.addEventListener("pointerdown", (event) => {
  surface.focus();
  surface.setPointerCapture(event.pointerId);
  link.send({ type: "hold" });
  const over = event.button === 0 ? overlay.at(...local(event)) : null;
  const how = event.button === 2 ? "turn" : event.button === 1 || event.shiftKey ? "pan" : "orbit";
  drag = { how, x: event.clientX, y: event.clientY, moved: 0, over, gesture: gesture() };
  if (over === "free" || typeof over === "number") { overlay.begin(over, ...local(event)); drag.how = "handle"; }
  surface.classList.add("dragging");
});
let told = 0; // ms, when the last `hold` was sent
let under = null; // the place in the picture that the pointer is over
surface.addEventListener("pointerleave", () => { under = null; });
surface.addEventListener("pointermove", (event) => {
  const [x, y] = part(event);
  under = x >= 0 && x <= 1 && y >= 0 && y <= 1 ? [x, y] : null;
  if (!drag) {
    if (performance.now() - told > 100) { told = performance.now(); link.send({ type: "hold" }); } // a drag may begin
    const hover = overlay.at(...local(event));
    surface.classList.toggle("over", hover !== null);
    if (JSON.stringify(hover) !== JSON.stringify(overlay.hover)) { overlay.hover = hover; overlay.draw(); }
    return;
  }
  const dx = event.clientX - drag.x, dy = event.clientY - drag.y, height = overlay.rect.height;
  Object.assign(drag, { x: event.clientX, y: event.clientY, moved: drag.moved + Math.abs(dx) + Math.abs(dy) });
  if (drag.moved < 4) return;
  if (drag.how === "handle") {
    const { offset } = overlay.about.handle, value = overlay.move(...local(event)).map((v, k) => v - offset[k]);
    link.soon("handle", { type: "change", what: "node", node: overlay.drag.node, field: "place", value, gesture: drag.gesture });
    overlay.draw();
  } else if (drag.how === "pan") {
    link.soon("pan", { type: "pan", right: dx / height, up: -dy / height }, sum("right", "up"));
  } else if (drag.how === "turn") {
    link.soon("turn", { type: "look", how: "turn", right: 2 * dx / height, down: 2 * dy / height }, sum("right", "down"));
  } else {
    link.soon("look", { type: "look", right: Math.PI * dx / height, down: Math.PI * dy / height }, sum("right", "down"));
  }
});
const end = (event) => {
  if (!drag) return;
  surface.classList.remove("dragging");
  const { moved, how, over } = drag;
  drag = null;
  if (overlay.drag) { link.flush(); overlay.about.handle.place = overlay.drag.place; overlay.drag = null; overlay.draw(); }
  if (event.type !== "pointerup" || moved >= 4 || how === "handle" || how === "turn") return;
  const [x, y] = part(event);
  if (inspector.on && x >= 0 && x <= 1 && y >= 0 && y <= 1) inspector.at(x, y);
  else if (over && over.light) link.send({ type: "select", node: over.light });
  else if (x >= 0 && x <= 1 && y >= 0 && y <= 1) link.send({ type: "pick", x, y });
};
surface.addEventListener("pointerup", end);
surface.addEventListener("pointercancel", end);
surface.addEventListener("contextmenu", (event) => event.preventDefault());
surface.addEventListener("dblclick", (event) => {
  const [x, y] = part(event);
  if (x >= 0 && x <= 1 && y >= 0 && y <= 1) link.send({ type: "focus", x, y });
});
surface.addEventListener("wheel", (event) => {
  event.preventDefault();
  const lines = event.deltaMode === 1 ? 30 : 1;
  link.soon("zoom", { type: "zoom", steps: Math.max(-2, Math.min(2, -event.deltaY * lines / 400)) }, sum("steps"));
}, { passive: false });

// -- keys ----------------------------------------------------------------------------------------------------

const held = new Map();
let flown = 0;
function fly(now) {
  if (!held.size) return;
  const dt = Math.min((now - flown) / 1000, 0.1);
  flown = now;
  const [right, up, ahead] = [0, 1, 2].map((k) => [...held.values()].reduce((s, v) => s + v[k], 0) * dt * 0.7);
  if (right || up || ahead) link.soon("fly", { type: "fly", right, up, ahead }, sum("right", "up", "ahead"));
  requestAnimationFrame(fly);
}
function hold(key, way) {
  if (!held.size) { flown = performance.now(); requestAnimationFrame(fly); }
  held.set(key, way);
}
addEventListener("blur", () => held.clear());
addEventListener("keyup", (event) => { held.delete(event.key); held.delete(event.key.toLowerCase()); });
addEventListener("keydown", (event) => {
  const typing = event.target.matches("input:not([type=range]):not([type=checkbox]), select, textarea") || $("help").open;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, command = event.ctrlKey || event.metaKey;
  if (typing) { if (key === "Escape") event.target.blur(); return; }
  const chosen = panels.chosen, done = () => event.preventDefault();
  if (command && key === "z") { link.send({ type: event.shiftKey ? "redo" : "undo" }); return done(); }
  if (command && key === "y") { link.send({ type: "redo" }); return done(); }
  if (command && key === "d") { if (chosen !== null) link.send({ type: "duplicate", node: chosen }); return done(); }
  if (command || event.altKey) return;
  if (drag && drag.how === "turn" && FLY_HELD[key]) { hold(key, FLY_HELD[key]); return done(); }
  if (FLY[event.key] && !event.target.matches("input[type=range]")) { hold(event.key, FLY[event.key]); return done(); }
  const action = {
    "?": () => $("help").showModal(), f: () => link.send({ type: "frame", node: chosen }), r: () => link.send({ type: "camera", index: null }),
    s: screenshot, c: copy, h: () => hide(), i: () => inspector.toggle(under), "[": () => fold("left"), "]": () => fold("right"), " ": () => timeline.toggle(),
    Delete: () => chosen !== null && link.send({ type: "delete", node: chosen }), Escape: () => (inspector.on ? inspector.toggle(null) : link.send({ type: "select", node: null })),
  }[key];
  if (action && !event.repeat) { action(); done(); }
  const view = $("view").options[Number(key) - 1];
  if (/^[1-9]$/.test(key) && view) link.send({ type: "show", view: view.value });
});
function hide() {
  const row = panels.scene && panels.scene.rows.find((r) => r[0] === panels.chosen);
  if (row) link.send({ type: "change", what: "node", node: row[0], field: "hidden", value: !row[4] });
}

// -- files, commands, panels ---------------------------------------------------------------------------------

async function download(what, name) {
  panels.say(`making ${name} …`);
  const answer = await link.fetch(what);
  if (!answer.ok) return panels.say(await answer.text(), true);
  const url = URL.createObjectURL(await answer.blob()), anchor = document.createElement("a");
  Object.assign(anchor, { href: url, download: name });
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
  return panels.say(`${name} is among your downloads`);
}
const base = () => (panels.scene && (panels.scene.name || "scene").replace(/[^\w.-]+/g, "-")) || "scene";
function screenshot() { download("picture.png", `${base()}.png`); }
async function copy() {
  try {
    await navigator.clipboard.writeText(panels.command);
    panels.say(`copied: ${panels.command}`);
  } catch { panels.say(panels.command); }
}
async function upload(file) {
  if (file.size > 64 * 2 ** 20) return panels.say(`${file.name}: is larger than 64 MiB; open it from the command line`, true);
  panels.say(`opening ${file.name} …`);
  const answer = await link.fetch(`scene?name=${encodeURIComponent(file.name)}`, { method: "PUT", body: file });
  return answer.ok ? panels.say(`${file.name} is open`) : panels.say((await answer.text()).trim(), true);
}
function fold(side) {
  document.body.classList.toggle(`no-${side}`);
  localStorage.setItem(`ispm-no-${side}`, document.body.classList.contains(`no-${side}`));
}
for (const side of ["left", "right"]) {
  if (localStorage.getItem(`ispm-no-${side}`) === "true") document.body.classList.add(`no-${side}`);
  $(`fold-${side}`).addEventListener("click", () => fold(side));
}
if (innerHeight <= 560) $("cost-box").open = false;
$("undo").addEventListener("click", () => link.send({ type: "undo" }));
$("redo").addEventListener("click", () => link.send({ type: "redo" }));
$("shot").addEventListener("click", screenshot);
$("copy").addEventListener("click", copy);
$("save").addEventListener("click", () => download("scene.glb", `${base()}.glb`));
$("help-button").addEventListener("click", () => $("help").showModal());
for (const [key, what] of KEYS) {
  const line = $("keys").insertRow();
  line.insertCell().textContent = key;
  line.insertCell().textContent = what;
}
addEventListener("dragover", (event) => { event.preventDefault(); stage.classList.add("dropping"); });
addEventListener("dragleave", (event) => { if (!event.relatedTarget) stage.classList.remove("dropping"); });
addEventListener("drop", (event) => {
  event.preventDefault();
  stage.classList.remove("dropping");
  if (event.dataTransfer.files.length) upload(event.dataTransfer.files[0]);
});
