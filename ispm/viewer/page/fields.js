// Controls made from descriptions of fields; what is being edited is not overwritten.
let gestures = Math.floor(Math.random() * 1e6) * 1000;
export const gesture = () => ++gestures;

const encode = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
const decode = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const hex = (color) => "#" + color.map((v) => Math.round(255 * encode(Math.min(Math.max(v, 0), 1))).toString(16).padStart(2, "0")).join("");
const linear = (text) => [1, 3, 5].map((k) => decode(parseInt(text.slice(k, k + 2), 16) / 255));
const shown = (v) => (v === null ? "∞" : typeof v === "number" ? String(+v.toPrecision(5)) : String(v));

export function make(tag, about = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(about)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "class") element.className = value;
    else if (key in element) element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

// A row for a field; `set(value, gesture)` sends what is entered. The row's `update(field)` shows another value.
export function row(field, set) {
  const control = CONTROLS[field.kind](field, set);
  const element = make("label", { class: field.kind === "vector" && field.label.length < 9 ? "row wide" : "row", title: field.help || "" }, make("span", { textContent: field.label }), control);
  element.update = (next) => control.update(next);
  control.update(field);
  return element;
}

const CONTROLS = {
  choice(field, set) {
    const select = make("select", { onchange: () => set(select.value) },
      ...field.choices.map((name) => make("option", { value: name, textContent: name })));
    select.update = (next) => { select.value = next.value; };
    return select;
  },
  switch(_, set) {
    const box = make("input", { type: "checkbox", onchange: () => set(box.checked) });
    box.update = (next) => { box.checked = next.value; };
    return box;
  },
  text(_, set) {
    const input = make("input", { type: "text", maxLength: 200, onchange: () => set(input.value) });
    input.update = (next) => { if (document.activeElement !== input) input.value = next.value; };
    return input;
  },
  color(_, set) {
    let held = 0;
    const input = make("input", { type: "color" });
    input.addEventListener("input", () => { held ||= gesture(); set(linear(input.value), held); });
    input.addEventListener("change", () => { held = 0; });
    input.update = (next) => { if (!held) input.value = hex(next.value); };
    return input;
  },
  number(field, set) {
    const box = make("span", { class: "box" }), slide = slider(field, set), input = entry(field, set);
    box.append(...(slide ? [slide, input] : [input]));
    box.classList.toggle("only", !slide);
    box.update = (next) => { input.update(next); if (slide) slide.update(next); };
    return box;
  },
  vector(field, set) {
    const box = make("span", { class: "box three" });
    if (!Array.isArray(field.value)) return CONTROLS.number(field, set);
    let now = [...field.value];
    const inputs = now.map((_, k) => entry(field, (value, held) => { now = [...now]; now[k] = Number(value); set(now, held); }));
    box.append(...inputs);
    box.update = (next) => { now = [...next.value]; inputs.forEach((input, k) => input.update({ value: now[k] })); };
    return box;
  },
};

// A text box for a number, or a word: arrow keys step, and a drag to the sides changes it.
function entry(field, set) {
  const input = make("input", { type: "text", inputMode: "decimal", title: field.unit ? `${field.label}, ${field.unit}` : "" });
  const send = (held) => {
    const text = input.value.trim(), value = Number(text);
    set(text !== "" && Number.isFinite(value) ? value : text === "∞" ? "" : text, held);
  };
  input.addEventListener("change", () => send(0));
  input.addEventListener("keydown", (event) => {
    const step = { ArrowUp: 1, ArrowDown: -1 }[event.key], value = Number(input.value);
    if (!step || !Number.isFinite(value)) return;
    const size = field.whole ? Math.max(1, Math.round(Math.abs(value) * 0.05)) : Math.max(0.01, Math.abs(value) * 0.05);
    input.value = shown(value + step * size);
    send(0);
    event.preventDefault();
  });
  input.update = (next) => { if (document.activeElement !== input) input.value = shown(next.value); };
  return input;
}

function slider(field, set) {
  let { least, most } = field;
  if (most === null || most === undefined || least === undefined || !(most < 1e7)) {
    if (field.scale !== "log") return null;
    least = (field.value || 1) / 100; // about what it is when it is selected
    most = (field.value || 1) * 100;
  }
  const log = field.scale === "log" || most - least > 2000, low = log && field.scale !== "log" ? Math.max(least, 1) : least;
  const from = (t) => (log ? (t <= 0 ? least : low * (most / low) ** t) : least + t * (most - least));
  const to = (v) => (log ? (v <= low ? 0 : Math.log(v / low) / Math.log(most / low)) : (v - least) / (most - least));
  const input = make("input", { type: "range", min: 0, max: 1, step: 0.001 });
  let held = 0;
  input.addEventListener("input", () => {
    held ||= gesture();
    const value = from(Number(input.value));
    set(field.whole ? Math.round(log ? +value.toPrecision(2) : value) : +value.toPrecision(3), held);
  });
  input.addEventListener("change", () => { held = 0; });
  input.update = (next) => { if (!held) input.value = typeof next.value === "number" ? to(next.value) : 0; };
  return input;
}

// Rows for fields in an element: made anew where other fields are to be shown, else updated.
export function rows(element, fields, key, set) {
  const names = key + fields.map((f) => f.name + f.kind + Array.isArray(f.value)).join();
  if (element.shownNames !== names) {
    element.shownNames = names;
    element.replaceChildren();
    element.shownRows = fields.map((field) => row(field, (value, held) => set(field.name, value, held || 0)));
    element.append(...element.shownRows);
  }
  fields.forEach((field, k) => element.shownRows[k].update(field));
}
