// Complex modes: the stability diagram of a design point, one mode, tracks along a parameter.
const own = data.own, UNSTABLE = 1, UNCERTAIN = 2, OVERDAMPED = 4, AMBIGUOUS = 8;
const [unstableColour, stableColour] = data.colours;
const columns = {};
const offsets = new Int32Array(points.n + 1);
numbers(own.counts).forEach((n, i) => { offsets[i + 1] = offsets[i] + n; });
for (const name of ["mode", "track", "flags", "frequency_hz", "growth_rate", "error_estimate"]) {
  columns[name] = own[name] ? numbers(own[name]) : new Float64Array(own.n).fill(NaN);
}
const {frequency_hz: hertz, growth_rate: growth, error_estimate: error, track, mode, flags} = columns;
const shares = own.shares.map(() => null);
const share = (k, i) => (shares[k] ??= numbers(own.shares[k]))[i];
const damping = i => -growth[i] / (2 * Math.PI * hertz[i]);
const has = (i, bit) => (flags[i] & bit) !== 0;
const stability = i => has(i, UNCERTAIN) ? "uncertain" : has(i, UNSTABLE) ? "unstable" : "stable";
const inBand = i => !state.band || (hertz[i] >= state.band[0] && hertz[i] <= state.band[1]);
const called = i => isNaN(track[i]) ? `mode ${mode[i]}` : `T${track[i]}`;
const callName = i => own.names[track[i]] ? `${called(i)} (${own.names[track[i]]})` : called(i);
const look = i => has(i, UNCERTAIN) ? ["#FFFFFF", "#000000", "diamond"] : has(i, UNSTABLE) ?
  [unstableColour, unstableColour, "square"] : ["#FFFFFF", stableColour, has(i, OVERDAMPED) ? "x" : "circle"];
let fastestOfAll = 0;
for (const g of growth) if (g > fastestOfAll) fastestOfAll = g;
const HEADS = [["name", "mode"], ["hertz", "frequency Hz"], ["growth", "growth 1/s"], ["damping", "damping %"], ["error", "± 1/s"], ["state", "stability"]];
const sorts = {name: i => track[i], hertz: i => hertz[i], growth: i => -growth[i], damping, error: i => -error[i], state: i => -flags[i]};
let sorted = "growth", backwards = false;

function modeText(i) {
  const lines = [callName(i), `${digits(hertz[i], 6)} Hz`, `growth ${digits(growth[i], 6)} 1/s`];
  lines.push(`damping ratio ${digits(100 * damping(i), 3)} %`);
  if (!isNaN(error[i])) lines.push(`error ± ${digits(error[i], 2)} 1/s`);
  lines.push(stability(i) + (has(i, OVERDAMPED) ? ", overdamped" : "") + (has(i, AMBIGUOUS) ? ", following it is in doubt" : ""));
  return lines.join("\n");
}
detail.start = () => {
  const top = fastestOfAll || 10;
  const {plot} = figures.diagram;
  limits(plot.x_range, ...padded(hertz));
  limits(plot.y_range, -1.5 * top, 1.2 * top);
  handlers.diagram = {tap: i => chooseMode(state.modes[i]), text: i => modeText(state.modes[i]), brush: g => setBand(g.x0, g.x1)};
  handlers.line = {tap: i => { const k = state.linePoints[i]; choose(rowOf(k)); chooseMode(k); }, text: i => `${atText(rowOf(state.linePoints[i]))}\n${modeText(state.linePoints[i])}`};
  keys("diagram", right => {
    const order = [...state.modes].sort((a, b) => hertz[a] - hertz[b]);
    chooseMode(order[Math.max(0, Math.min(order.length - 1, order.indexOf(state.mode) + (right || 0)))]);
  });
  fill($("diagram-legend"), entry("unstable", unstableColour, "square"), entry("stable", stableColour, "ring"),
    entry("uncertain", "#FFFFFF", "diamond"), entry("modes of selected points", data.grey, "circle"));
  for (const id of ["band-low", "band-high"]) $(id).onchange = () => setBand(+$("band-low").value || 0, +$("band-high").value || Infinity);
  $("band-all").onclick = () => setBand(0, Infinity);
  alongControls(() => drawLine());
  $("quantity").onchange = () => drawLine();
  const head = element("tr");
  for (const [key, title] of HEADS) {
    const cell = element("th", "", {scope: "col"}), button = element("button", title);
    button.onclick = () => { backwards = sorted === key && !backwards; sorted = key; table(); };
    cell.append(button);
    head.append(cell);
  }
  fill($("modes-head"), head);
};
const rowOf = i => {  // the design point of a mode
  let low = 0, high = points.n;
  while (high - low > 1) { const middle = (low + high) >> 1; if (offsets[middle] <= i) low = middle; else high = middle; }
  return low;
};
function setBand(low, high) {
  const whole = !(low > 0) && !isFinite(high);
  state.band = whole ? null : [Math.max(0, Math.min(low, high)), Math.max(low, high)];
  $("band-low").value = whole ? "" : Math.round(state.band[0]);
  $("band-high").value = whole || !isFinite(state.band[1]) ? "" : Math.round(state.band[1]);
  showBrush("diagram", state.band && [state.band[0], Math.min(state.band[1], 1e9)], null);
  bandMeasure();
  detail.point(state.point);
  take();
}
function bandMeasure() {  // the fastest mode in the band, of each design point
  const name = "fastest growth in the band", at = data.measures.findIndex(m => m.name === name);
  if (at >= 0) data.measures.splice(at, 1);
  if (state.band) {
    const x = new Float64Array(points.n).fill(NaN), bad = new Uint8Array(points.n);
    for (let row = 0; row < points.n; row++) {
      for (let i = offsets[row]; i < offsets[row + 1]; i++) {
        if (!inBand(i)) continue;
        if (!(growth[i] <= x[row])) x[row] = growth[i];
        if (has(i, UNSTABLE)) bad[row] = 1;
      }
    }
    data.measures.push({name, unit: "1/s", x, bad});  // last: places of the others stay
    measure = data.measures.at(-1);
  } else if (!data.measures.includes(measure)) measure = data.measures[0];
  options($("colour"), data.measures.map((m, i) => [i, m.name]), data.measures.indexOf(measure));
  drawMap();
}
detail.taken = () => state.band ? [isFinite(state.band[1]) ? `${digits(state.band[0], 7)} <= frequency_hz <= ${digits(state.band[1], 7)}` : `frequency_hz >= ${digits(state.band[0], 7)}`] : [];
detail.selected = () => drawOthers();
const heldHere = own.lightest === null ? "here" : "of this design point on this page";  // not all
detail.said = row => {
  const n = offsets[row + 1] - offsets[row];
  if (!n) return points.status.length && points.status[row] !== "ok" ? "" : `No mode ${heldHere}.`;
  let unstable = 0;
  for (let i = offsets[row]; i < offsets[row + 1]; i++) unstable += has(i, UNSTABLE);
  return `${unstable} of ${n} modes ${heldHere} ${unstable === 1 ? "is" : "are"} unstable.`;
};
detail.point = row => {
  const before = state.mode === undefined ? NaN : track[state.mode];
  state.modes = [];
  for (let i = offsets[row]; i < offsets[row + 1]; i++) if (inBand(i)) state.modes.push(i);
  const found = {x: [], y: [], fill: [], line: [], size: [], marker: []};
  for (const i of state.modes) {
    const [inside, line, marker] = look(i);
    found.x.push(hertz[i]); found.y.push(growth[i]); found.fill.push(inside);
    found.line.push(line); found.size.push(10); found.marker.push(marker);
  }
  figures.diagram.source("points").data = found;
  const fastest = state.modes.reduce((best, i) => best === undefined || growth[i] > growth[best] ? i : best, undefined);
  const again = state.modes.find(i => track[i] === before);
  drawOthers();
  chooseMode(again ?? fastest);
};
function drawOthers() {
  const x = [], y = [], most = 10000;
  for (const row of selectedRows()) for (let i = offsets[row]; i < offsets[row + 1] && x.length < most; i++) if (inBand(i)) { x.push(hertz[i]); y.push(growth[i]); }
  const same = value => x.map(() => value);
  figures.diagram.source("others").data = {x, y, fill: same(data.grey), line: same(null), size: same(4), marker: same("circle")};
}
function table() {
  const order = [...state.modes].sort((a, b) => (sorts[sorted](a) - sorts[sorted](b) || 0) * (backwards ? -1 : 1));
  fill($("modes"), ...order.map(i => {
    const row = element("tr", "", {"aria-selected": i === state.mode}), name = element("td"), button = element("button", callName(i));
    button.onclick = () => chooseMode(i);
    name.append(button);
    const texts = [digits(hertz[i], 6), digits(growth[i], 6), digits(100 * damping(i), 3), digits(error[i], 2)];
    row.append(name, ...texts.map(text => element("td", text)), element("td", stability(i), {class: stability(i)}));
    return row;
  }));
}
function chooseMode(i) {
  state.mode = i;
  table();
  drawLine();
  const none = i === undefined;
  figures.diagram.source("chosen").data = none ? {x: [], y: []} : {x: [hertz[i]], y: [growth[i]]};
  $("mode-title").textContent = none ? "Mode" : `${callName(i)}, ${digits(hertz[i], 6)} Hz`;
  $("mode-facts").textContent = none ? `This design point has no mode${state.band ? " in the chosen band" : ""} on this page.` : modeText(i).split("\n").slice(1).join(", ") + `; mode ${mode[i]} at the point`;
  const parts = none ? [] : own.energies.map((name, k) => [name, share(k, i)]).filter(([, v]) => v >= .0005).sort((a, b) => b[1] - a[1]);
  fill($("energies"), ...parts.flatMap(([name, v]) => [element("span", name), element("i", "", {style: `width:${100 * v}%`}), element("span", `${digits(100 * v, 2)} %`)]));
  if (!parts.length) fill($("energies"), element("span", "not known"));
  shape(i);
}
function shape(i) {
  const stored = i === undefined ? {} : data.shapes[`${state.point} T${track[i]}`] || data.shapes[`${state.point} ${mode[i]}`] || {};
  const name = i === undefined ? "" : `Shape of ${callName(i)}`, parts = [];
  if (stored.html) {
    const frame = element("iframe", "", {class: "shape", title: `${name}, moving`, sandbox: "allow-scripts"});
    frame.srcdoc = stored.html;
    parts.push(frame);
  }
  if (stored.png) parts.push(element("img", "", {class: "shape", alt: name, src: `data:image/png;base64,${stored.png}`}));
  if (!parts.length && i !== undefined) {
    const folder = /^[\w.\/-]+$/.test(data.directory) ? data.directory : `'${data.directory.replaceAll("'", "'\\''")}'`;
    parts.push(element("p", "No shape of this mode is stored. If the model has a mesh, this command makes one, and a page made afterwards shows it:"),
      element("pre", `squealstudy shape ${folder} --point ${points.rows[state.point]} --mode ${mode[i]}`));
  }
  fill($("shape"), ...parts);
}
function drawLine() {
  const along = named($("along").value), {plot, source} = figures.line, quantity = $("quantity").value;
  placeSlider(along);
  const value = {growth: i => growth[i], frequency: i => hertz[i], damping: i => 100 * damping(i)}[quantity];
  const tracks = new Map();
  for (const row of state.line) for (let i = offsets[row]; i < offsets[row + 1]; i++) {
    if (isNaN(track[i]) || !inBand(i)) continue;
    if (!tracks.has(track[i])) tracks.set(track[i], []);
    tracks.get(track[i]).push(i);
  }
  const fastest = new Map([...tracks].map(([t, rows]) => [t, Math.max(...rows.map(i => growth[i]))]));
  const growing = [...tracks.keys()].filter(t => tracks.get(t).some(i => has(i, UNSTABLE))).sort((a, b) => fastest.get(b) - fastest.get(a));
  const colours = new Map(growing.slice(0, 6).map((t, k) => [t, data.colours[k]]));
  const here = state.mode === undefined ? NaN : track[state.mode];
  const lines = {xs: [], ys: [], colour: [], width: [], dash: []}, dots = {x: [], y: [], fill: [], line: [], size: [], marker: []};
  const at = i => along ? along.x[rowOf(i)] * along.factor : points.rows[rowOf(i)];
  const place = new Map(state.line.map((row, k) => [row, k])), dot = state.line.length > 60 ? 4 : 7;
  state.linePoints = [];
  for (const [t, rows] of [...tracks].sort((a, b) => colours.has(a[0]) - colours.has(b[0]))) {
    const colour = colours.get(t) || (t === here ? data.dark : "#C4C4C4");
    const [xs, ys] = [[], []];
    rows.forEach((i, k) => {  // no line over a design point at which the track is missing
      if (k && place.get(rowOf(i)) > place.get(rowOf(rows[k - 1])) + 1) { xs.push(NaN); ys.push(NaN); }
      xs.push(at(i)); ys.push(value(i));
    });
    lines.xs.push(xs); lines.ys.push(ys); lines.colour.push(colour);
    lines.width.push(t === here ? 3.5 : colours.has(t) ? 2 : 1); lines.dash.push("solid");
    for (const i of rows) {
      const strong = colours.has(t) || t === here;
      dots.x.push(at(i)); dots.y.push(value(i)); dots.line.push(colour); dots.size.push(strong ? dot : 3);
      dots.fill.push(has(i, UNSTABLE) ? colour : "#FFFFFF"); dots.marker.push(has(i, UNSTABLE) ? "square" : "circle");
      state.linePoints.push(i);
    }
  }
  source("lines").data = lines;
  source("points").data = dots;
  const chosen = state.mode !== undefined && !isNaN(here);
  source("chosen").data = chosen ? {x: [at(state.mode)], y: [value(state.mode)]} : {x: [], y: []};
  plot.below[0].axis_label = plainText(along ? along.label : "number of the point");
  plot.left[0].axis_label = {growth: "growth rate [1/s]", frequency: "frequency [Hz]", damping: "damping ratio [%]"}[quantity];
  limits(plot.x_range, ...padded(along ? along.distinct.map(v => v * along.factor) : [points.rows[state.point]]));
  const top = fastestOfAll || 10, strong = dots.y.filter((_, k) => dots.size[k] > 3);
  limits(plot.y_range, ...(quantity === "growth" ? [-1.5 * top, 1.2 * top] : quantity === "frequency" ? padded(dots.y) : [padded(strong)[0], 3]));
  source("here").location = along ? along.x[state.point] * along.factor : points.rows[state.point];
  source("zero").visible = quantity !== "frequency";
  fill($("line-legend"), ...growing.slice(0, 6).map(t => entry(callName(tracks.get(t)[0]), colours.get(t), "dash")), ...(tracks.size > colours.size ? [entry("other modes", "#C4C4C4", "dash")] : []));
  const others = parameters.filter(p => p !== along);
  $("line-note").textContent = state.line.length < 2 ? `No other design point on this page differs from this one in ${along ? along.name : "a parameter"} alone.` :
    `${state.line.length} design points${others.length ? ` at ${atText(state.point, others)}` : ""}. Filled squares are unstable.`;
}
