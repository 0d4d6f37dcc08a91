// What all pages share: numbers, words, figures, the chosen design point, the selection.
const data = JSON.parse(document.getElementById("data").textContent);
const $ = id => document.getElementById(id);
const points = data.points, parameters = points.parameters;
const detail = {};  // what the script of the kind does: start, point(row), along(), taken()
const state = {point: 0, ranges: new Map(), fixed: new Map(), band: null};
const figures = {};

function buffer(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes.buffer;
}
function numbers(packed) {
  if (packed.bits === 64) return new Float64Array(buffer(packed.text));
  if (packed.bits === 32) return Float64Array.from(new Float32Array(buffer(packed.text)));
  const codes = new Uint16Array(buffer(packed.text)), found = new Float64Array(codes.length);
  const {low, step} = packed;
  for (let i = 0; i < codes.length; i++) found[i] = codes[i] === 65535 ? NaN : low + step * codes[i];
  return found;
}
for (const p of parameters) {
  p.x = numbers(p.values);
  p.distinct = Float64Array.from(new Set(p.x.filter(isFinite))).sort();
  const place = new Map([...p.distinct].map((v, i) => [v, i]));
  p.code = Int32Array.from(p.x, v => place.has(v) ? place.get(v) : -1);
  p.label = p.unit ? `${p.name} [${p.unit}]` : p.name;
}
for (const m of data.measures) {
  m.x = numbers(m.values);
  if (m.unstable) m.bad = numbers(m.unstable);
}
const named = name => parameters.find(p => p.name === name);

// -- words
function digits(value, most = 4) {
  if (!Number.isFinite(value)) return "-";
  const short = +value.toPrecision(most);
  return Math.abs(short) >= 1e6 ? short.toExponential().replace("e+", "e") : String(short);
}
const inUnit = (text, unit) => unit ? `${text} ${unit}` : text;
const valueText = (p, value) => inUnit(digits(value * p.factor, 6), p.unit);
const atText = (row, among = parameters) =>
  among.map(p => `${p.name} ${valueText(p, p.x[row])}`).join(", ") || "the only design point";
function element(tag, text = "", more = {}) {
  const made = document.createElement(tag);
  made.textContent = text;
  for (const [name, value] of Object.entries(more)) made.setAttribute(name, value);
  return made;
}
const fill = (parent, ...children) => parent.replaceChildren(...children);
function options(select, names, chosen) {
  fill(select, ...names.map(([value, text]) => element("option", text, {value})));
  select.value = chosen;
}
const GLYPHS = {square: "■", circle: "●", diamond: "◆", triangle: "▲", circle_cross: "⊕", ring: "○", x: "✕", star: "★", inverted_triangle: "▼", dash: "━"};
function entry(text, colour, marker) {
  const made = element("span");
  made.append(element("b", GLYPHS[marker], {style: `color:${colour}`}), text);
  return made;
}

// -- figures
const plainText = text => new (Bokeh.Models.get("PlainText"))({text});  // no $$formula$$ of a name
async function embed() {
  for (const [id, item] of Object.entries(data.figures)) {
    await Bokeh.embed.embed_item(item, id);
    const file = Bokeh.documents.at(-1);
    figures[id] = {plot: file.get_model_by_name(id), source: name => file.get_model_by_name(name)};
  }
}
const whole = new Map();  // limits of each range, to which its figure is reset
function limits(range, low, high) {
  if (!(high > low)) [low, high] = [low - .5 * (Math.abs(low) || 1), high + .5 * (Math.abs(high) || 1)];
  range.setv({start: low, end: high});
  whole.set(range, [low, high]);
}
function showBrush(name, x, y) {  // a box between values across and up; null: all of the figure
  const {plot, source} = figures[name], far = r => [r.start - 9 * (r.end - r.start), r.end + 9 * (r.end - r.start)];
  const [left, right] = x || far(plot.x_range), [bottom, top] = y || far(plot.y_range);
  source("brush").setv({left, right, bottom, top, visible: Boolean(x || y)});
}
function padded(values, share = .06) {
  let low = Infinity, high = -Infinity;
  for (const v of values) if (Number.isFinite(v)) { if (v < low) low = v; if (v > high) high = v; }
  if (low > high) return [0, 1];
  const pad = (high - low) * share || .5 * (Math.abs(low) || 1);
  return [low - pad, high + pad];
}
function nearest(name, event, most = 24) {  // place among the points of a figure, in pixels
  const {plot, source} = figures[name], {x, y} = source("points").data;
  const across = plot.inner_width / (plot.x_range.end - plot.x_range.start);
  const up = plot.inner_height / (plot.y_range.end - plot.y_range.start);
  let best = -1, least = most * most;
  for (let i = 0; i < x.length; i++) {
    const dx = (x[i] - event.x) * across, dy = (y[i] - event.y) * up, d = dx * dx + dy * dy;
    if (d < least) { least = d; best = i; }
  }
  return best;
}
function tip(name, event, text) {
  const box = $("tip");
  box.hidden = !text;
  if (!text) return;
  box.textContent = text;
  const frame = $(name).getBoundingClientRect();
  const left = frame.left + event.sx + 16, top = frame.top + event.sy + 16;
  box.style.left = `${Math.max(4, Math.min(left, innerWidth - box.offsetWidth - 8))}px`;
  box.style.top = `${Math.max(4, Math.min(top, innerHeight - box.offsetHeight - 8))}px`;
}
const handlers = {};  // by figure: tap(place), text(place), brush(geometry)
window.squealstudy = {
  happened(name, event) {
    const own = handlers[name] || {};
    if (event.event_name === "reset") {
      const {plot} = figures[name];
      for (const range of [plot.x_range, plot.y_range]) limits(range, ...whole.get(range));
    } else if (event.event_name === "mouseleave") tip(name, event, "");
    else if (event.event_name === "selectiongeometry") { if (event.final && own.brush) own.brush(event.geometry); }
    else if (own.text) {
      const place = nearest(name, event);
      if (event.event_name === "mousemove") tip(name, event, place < 0 ? "" : own.text(place));
      else if (place >= 0) own.tap(place);  // tap, or doubletap: a second point within .3 s of the first
    }
  },
};
function keys(name, move) {  // arrow keys: (right, up) of -1, 0, 1
  const steps = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
  $(name).addEventListener("keydown", event => {
    if (!(event.key in steps) || event.target.closest("input, select")) return;
    event.preventDefault();
    move(...steps[event.key]);
  }, true);
}

// -- the chosen design point
function choose(row) {
  if (!(row >= 0 && row < points.n)) return;
  state.point = row;
  $("row").value = points.rows[row];
  const status = points.status.length && points.status[row] !== "ok" ? ` Status: ${points.status[row]}.` : "";
  const note = points.notes[row] ? ` ${points.notes[row]}` : "";
  $("facts").textContent = `Design point ${points.rows[row]}: ${atText(row)}.${status}${note} ${detail.said ? detail.said(row) : ""}`;
  mark();
  detail.point(row);
  take();
}
function step(by) {
  const shown = state.visible.length ? state.visible : [...points.ids.keys()];
  const at = shown.indexOf(state.point);
  choose(shown[Math.max(0, Math.min(shown.length - 1, at + by))]);
}
function sameLine(along) {  // design points that differ from the chosen one in one parameter alone
  const others = parameters.filter(p => p !== along), here = others.map(p => p.code[state.point]);
  const found = [];
  for (let i = 0; i < points.n; i++) if (others.every((p, k) => p.code[i] === here[k])) found.push(i);
  return found.sort((a, b) => along.x[a] - along.x[b]);
}
function alongControls(draw) {  // a parameter, and a slider over the design points along it
  const varied = parameters.filter(p => p.distinct.length > 1);
  options($("along"), varied.map(p => [p.name, p.name]), varied.length ? varied[0].name : "");
  $("along").onchange = () => { draw(); };
  $("place").oninput = () => choose(state.line[$("place").value]);
}
function placeSlider(along) {
  state.line = along ? sameLine(along) : [state.point];
  const slider = $("place"), text = along ? valueText(along, along.x[state.point]) : "";
  slider.max = state.line.length - 1;
  slider.value = state.line.indexOf(state.point);
  slider.disabled = state.line.length < 2;
  slider.setAttribute("aria-valuetext", text);
  $("place-text").textContent = text;
}

// -- the selection
const within = row => {
  for (const [p, [low, high]] of state.ranges) if (!(p.x[row] >= low && p.x[row] <= high)) return false;
  return true;
};
function selectedRows() {
  if (!state.ranges.size) return [];
  const found = [];
  for (let i = 0; i < points.n; i++) if (within(i)) found.push(i);
  return found;
}
function rangeControls() {
  for (const p of parameters) {
    const label = element("label", `${p.label} from `);
    p.ends = ["from", "to"].map(end => element("input", "", {type: "number", step: "any", "aria-label": `${p.name} ${end}`}));
    label.append(p.ends[0], " to ", p.ends[1]);
    $("ranges").append(label);
    const changed = () => {
      const [low, high] = p.ends.map(e => e.value === "" ? NaN : e.value / p.factor);
      if (isNaN(low) && isNaN(high)) state.ranges.delete(p);
      else snap(p, isNaN(low) ? -Infinity : low, isNaN(high) ? Infinity : high);
      selectionChanged();
    };
    p.ends.forEach(e => { e.onchange = changed; });
  }
  $("all").onclick = () => { state.ranges.clear(); selectionChanged(); };
}
function snap(p, low, high) {  // to values that there are; a typed end is met up to round-off
  const slack = 1e-9 * Math.max(Math.abs(low === -Infinity ? 0 : low), Math.abs(high === Infinity ? 0 : high));
  const inside = p.distinct.filter(v => v >= low - slack && v <= high + slack);
  state.ranges.set(p, inside.length ? [inside[0], inside.at(-1)] : [low, high]);
}
function selectionChanged() {
  for (const p of parameters) {
    const ends = state.ranges.get(p) || ["", ""];
    p.ends.forEach((e, k) => { e.value = ends[k] === "" || !isFinite(ends[k]) ? "" : +(ends[k] * p.factor).toPrecision(10); });
  }
  drawMap();
  if (detail.selected) detail.selected();
  take();
}

// -- what is taken along
const python = text => JSON.stringify(String(text));
const column = name => {  // as a query writes it, after the merge with `points`
  const clash = data.table.name !== "points" && data.table.columns.includes(name);
  const whole = clash ? `${name}_of_point` : name;
  return /^[A-Za-z_]\w*$/.test(whole) ? whole : `\`${whole}\``;
};
function condition() {
  const rows = selectedRows(), odd = [...state.ranges.keys()].some(p => /[`\\"'\n\r]/.test(p.name));
  if (!state.ranges.size) return [`point_id == '${points.ids[state.point]}'`];
  if (odd) return [`point_id in [${rows.map(i => `'${points.ids[i]}'`).join(", ")}]`];
  return [...state.ranges].map(([p, [low, high]]) => low === high ? `${column(p.name)} == ${low}` :
    [isFinite(low) ? `${low} <= ` : "", column(p.name), isFinite(high) ? ` <= ${high}` : ""].join(""));
}
function pandasLine() {
  const asked = [...condition(), ...(detail.taken ? detail.taken() : [])].join(" and ");
  return `${data.table.name}.query(${python(asked)})`;
}
function pandasAll() {
  const lines = ["import squealstudy as sq", "", `results = sq.open_results(${python(data.directory)})`];
  const table = data.table.name, chosen = data.where ? `.query(${python(data.where)})` : "";
  if (table === "points") lines.push(`points = results.points${chosen}`);
  else {
    lines.push(`points = results.points${chosen}[["point_id", *results.parameters]]`);
    lines.push(`${table} = results.${table}.merge(points, on="point_id", suffixes=("", "_of_point"))`);
  }
  return [...lines, pandasLine()].join("\n");
}
const told = (p, value) => p.temperature ? `"${value} degC"` : String(value);
function sweepText(p) {
  let ends = state.ranges.get(p), values = [...p.distinct];
  if (!state.ranges.size) {  // around the chosen point, along what the map shows
    const at = p.code[state.point], shown = [state.across, state.up].includes(p.name);
    ends = shown ? [values[Math.max(0, at - 1)], values[Math.min(values.length - 1, at + 1)]] : [values[at], values[at]];
  }
  const lines = ["", "[[sweep]]", `parameter = ${JSON.stringify(p.name)}`];
  if (!ends && values.length <= 60) return [...lines, `values = [${values.map(v => told(p, v)).join(", ")}]`];
  let [low, high] = ends || [values[0], values.at(-1)];
  [low, high] = [Math.max(low, values[0]), Math.min(high, values.at(-1))];
  if (!(low < high)) return [...lines, `values = [${told(p, low)}]`];
  const inside = values.filter(v => v >= low && v <= high).length;
  const num = inside > 60 ? 11 : Math.min(41, Math.max(9, 2 * inside - 1));
  lines.push(`start = ${told(p, low)}`, `stop = ${told(p, high)}`, `num = ${num}`);
  return p.log ? [...lines, 'scale = "log"'] : lines;
}
const studyText = () => [data.study.trimEnd(), ...parameters.filter(p => p.swept).flatMap(sweepText), ""].join("\n");
function take() {
  const n = state.ranges.size ? selectedRows().length : 0;
  $("selected").textContent = state.ranges.size ? `${n} of ${points.n} design points are selected.` :
    "No design points are selected: the lines below take the chosen one.";
  $("pandas").textContent = pandasAll();
  $("closer").hidden = !data.study || !parameters.some(p => p.swept);
  if (!$("closer").hidden) $("study").textContent = studyText();
}
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {  // a frame without the permission
    const area = element("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  $("copied").textContent = "Copied.";
}
function save(name, text) {
  const link = element("a", "", {download: name});
  link.href = URL.createObjectURL(new Blob([text], {type: "text/plain"}));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

async function start() {
  Bokeh.logger.set_level("error");
  await embed();
  fill($("notes"), ...data.notes.map(text => element("p", text)));
  rangeControls();
  $("copy-line").onclick = () => copy(pandasLine());
  $("copy-pandas").onclick = () => copy(pandasAll());
  $("copy-study").onclick = () => copy(studyText());
  $("save-study").onclick = () => save("closer.toml", studyText());
  $("before").onclick = () => step(-1);
  $("after").onclick = () => step(1);
  $("row").onchange = () => choose(points.rows.indexOf(+$("row").value));
  detail.start();
  startMap();
  document.body.dataset.ready = "yes";
}
