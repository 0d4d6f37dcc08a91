// The map of the design points.
const AS_NUMBER = "\u0000number", AS_MEASURE = "\u0000";  // before the place of a measure; no parameter is called so
const measureOf = key => key.startsWith(AS_MEASURE) && key !== AS_NUMBER ? data.measures[key.slice(1)] : undefined;
let measure = data.measures[0];

function startMap() {
  const varied = parameters.filter(p => p.distinct.length > 1);
  const swept = varied.filter(p => p.swept), order = [...swept, ...varied.filter(p => !p.swept)];
  const names = order.map(p => [p.name, p.name]);
  const number = [AS_NUMBER, "number of the point"];
  state.across = order.length ? order[0].name : AS_NUMBER;
  const level = data.measures.find(m => !m.words) || measure;
  const levels = data.measures.map((m, i) => [AS_MEASURE + i, m.name]);
  state.up = order.length > 1 ? order[1].name : AS_MEASURE + data.measures.indexOf(level);
  options($("across"), [...names, number], state.across);
  options($("up"), [...names, ...levels], state.up);
  options($("colour"), data.measures.map((m, i) => [i, m.name]), 0);
  let first = 0;
  level.x.forEach((v, i) => { if (v > (isNaN(level.x[first]) ? -Infinity : level.x[first])) first = i; });
  $("across").onchange = $("up").onchange = () => {
    [state.across, state.up] = [$("across").value, $("up").value];
    fixedControls(); drawMap(true); take();
  };
  $("colour").onchange = () => { measure = data.measures[$("colour").value]; drawMap(true); };
  handlers.map = {tap: i => choose(state.visible[i]), text: mapText, brush: mapBrush};
  keys("map", mapMove);
  state.point = first;
  fixedControls();
  drawMap(true);
  choose(first);
}
function fixedControls() {  // parameters that the map does not show, each at one value or at all
  const others = parameters.filter(p => p.distinct.length > 1 && ![state.across, state.up].includes(p.name));
  state.fixed = new Map();
  fill($("fixed"), ...others.filter(p => p.distinct.length <= 60).map(p => {
    const label = element("label", `${p.name} `), select = element("select", "", {"aria-label": p.name});
    options(select, [["all", "all"], ...[...p.distinct].map((v, i) => [i, valueText(p, v)])], p.code[state.point]);
    state.fixed.set(p, p.code[state.point]);
    select.onchange = () => {
      if (select.value === "all") state.fixed.delete(p); else state.fixed.set(p, +select.value);
      drawMap(true);
      if (!state.visible.includes(state.point) && state.visible.length) choose(counterpart());
    };
    label.append(select);
    return label;
  }));
}
function counterpart() {  // of the chosen point among those shown: what the map's axes have in common
  const axes = [state.across, state.up].map(named).filter(Boolean);
  return state.visible.find(i => axes.every(p => p.code[i] === p.code[state.point])) ?? state.visible[0];
}
function placesOf(key) {
  if (key === AS_NUMBER) return Float64Array.from(points.rows);
  if (measureOf(key)) return atEdge(measureOf(key).x);
  const p = named(key);
  return p.x.map(v => p.log ? Math.log10(v * p.factor) : v * p.factor);
}
function atEdge(x) {  // what is not known stands below all that is
  const [low, high] = padded(x, .08);
  return x.some(v => isNaN(v)) ? Float64Array.from(x, v => isNaN(v) ? low : v) : x;
}
function unknown(row) {  // whether its height on the map is not known
  const m = measureOf(state.up);
  return m !== undefined && isNaN(m.x[row]);
}
function apart(p) {  // the least step between values, over their range, as an axis has them
  const x = [...p.distinct].map(v => p.log ? Math.log(v) : v), wide = x.at(-1) - x[0];
  return Math.min(1, ...x.slice(1).map((v, i) => (v - x[i]) / wide));
}
function axisOf(axis, key, values) {
  const p = named(key), m = measureOf(key), words = m ? inUnit(m.name, m.unit && `[${m.unit}]`) : "number of the point";
  axis.axis_label = plainText(p ? (p.log ? `${p.label}, logarithmic` : p.label) : words);
  const few = p && p.distinct.length <= 12 && apart(p) > .08;
  if (few || (p && p.log)) {
    const ticks = few ? [...p.distinct].map(v => v * p.factor) : [1, 2, 5].flatMap(k => [...Array(25)].map((_, i) => k * 10 ** (i - 12)));
    const placed = ticks.map(v => p.log ? Math.log10(v) : v);
    axis.ticker = new (Bokeh.Models.get("FixedTicker"))({ticks: placed});
    axis.major_label_overrides = new Map(placed.map((t, i) => [t, digits(ticks[i])]));
  } else {
    axis.ticker = new (Bokeh.Models.get("BasicTicker"))();
    axis.major_label_overrides = new Map();
  }
  return padded(values, few && p.distinct.length > 1 ? .55 / (p.distinct.length - 1) : .05);
}
function looks(m) {  // colour and marker of a design point
  if (m.words) return i => [m.fills[m.x[i]], m.markers[m.x[i]]];
  const range = rows => rows.reduce(([low, high], i) => isNaN(m.x[i]) ? [low, high] : [Math.min(low, m.x[i]), Math.max(high, m.x[i])], [Infinity, -Infinity]);
  const all = [...m.x.keys()], shade = (map, share) => data.maps[map][Math.min(63, Math.max(0, Math.round(63 * share)))];
  if (!m.bad) {
    const [low, high] = m.ends = range(all);
    return i => isNaN(m.x[i]) ? [data.grey, "x"] : [shade("viridis", (m.x[i] - low) / (high - low || 1)), "circle"];
  }
  m.unstableEnds = range(all.filter(i => m.bad[i]));
  m.stableEnds = range(all.filter(i => !m.bad[i]));
  const size = ends => Math.max(...ends.map(Math.abs)) || 1, top = size(m.unstableEnds), bottom = size(m.stableEnds);
  return i => isNaN(m.x[i]) ? [data.grey, "x"] : m.bad[i] ?
    [shade("YlOrBr", Math.abs(m.x[i]) / top), "square"] : [shade("Blues", .75 * Math.abs(m.x[i]) / bottom), "circle"];
}
function drawMap(anew = false) {
  const {plot, source} = figures.map, x = placesOf(state.across), y = placesOf(state.up);
  const visible = [];
  for (let i = 0; i < points.n; i++) {
    let shown = true;
    for (const [p, code] of state.fixed) if (p.code[i] !== code) { shown = false; break; }
    if (shown) visible.push(i);
  }
  state.visible = visible;
  const look = looks(measure), chosen = state.ranges.size > 0, found = {x: [], y: [], fill: [], line: [], size: [], marker: []};
  const size = markerSize(visible);
  for (const i of visible) {
    const [colour, marker] = look(i);
    found.x.push(x[i]); found.y.push(y[i]); found.fill.push(colour);
    found.marker.push(unknown(i) ? "inverted_triangle" : marker); found.size.push(size);
    found.line.push(chosen && within(i) ? "#000000" : size > 7 || measure.words ? "#777777" : colour);
  }
  source("points").data = found;
  const ends = [axisOf(plot.below[0], state.across, visible.map(i => x[i])), axisOf(plot.left[0], state.up, visible.map(i => y[i]))];
  if (anew) { limits(plot.x_range, ...ends[0]); limits(plot.y_range, ...ends[1]); }
  state.x = x; state.y = y;
  brushBox();
  legend();
  mark();
}
function markerSize(visible) {
  const {plot} = figures.map;
  const counts = [state.across, state.up].map(key => named(key)?.distinct.length ?? visible.length);
  const cells = Math.min((plot.inner_width || 500) / counts[0], (plot.inner_height || 300) / counts[1]);
  const even = (plot.inner_width || 500) / Math.sqrt(visible.length * 2.5);
  return Math.max(4, Math.min(20, .85 * Math.max(cells, Math.min(even, 9))));
}
function mark() {
  const shown = state.visible?.includes(state.point);
  figures.map.source("chosen").data = shown ? {x: [state.x[state.point]], y: [state.y[state.point]]} : {x: [], y: []};
}
function measureText(m, v) {
  return m.words ? m.words[v] ?? "-" : inUnit(digits(v, 5), m.unit);
}
const knownMeasures = row => data.measures.filter(m => !isNaN(m.x[row])).map(m => `${m.name}: ${measureText(m, m.x[row])}`).join(", ") + ".";
function mapText(place) {
  const row = state.visible[place], here = atText(row).split(", ");
  const same = state.visible.filter(i => state.x[i] === state.x[row] && state.y[i] === state.y[row]).length;
  const lines = [`design point ${points.rows[row]}`, ...here, ...data.measures.map(m => `${m.name}: ${measureText(m, m.x[row])}`)];
  if (same > 1) lines.push(`${same - 1} more design point${same > 2 ? "s" : ""} at this place`);
  return lines.join("\n");
}
function mapBrush({x0, x1, y0, y1}) {
  for (const [key, low, high] of [[state.across, x0, x1], [state.up, y0, y1]]) {
    const p = named(key);
    if (!p) continue;
    const value = v => (p.log ? 10 ** v : v) / p.factor;
    snap(p, Math.min(value(low), value(high)), Math.max(value(low), value(high)));
  }
  selectionChanged();
}
function brushBox() {
  const {plot} = figures.map;
  const ends = [state.across, state.up].map(key => {
    const p = named(key), range = p && state.ranges.get(p);
    return range && range.map(v => p.log ? Math.log10(v * p.factor) : v * p.factor);
  });
  const pad = [plot.x_range, plot.y_range].map(r => .015 * Math.abs(r.end - r.start));
  showBrush("map", ...ends.map((e, k) => e ? [e[0] - pad[k], e[1] + pad[k]] : null));
}
function legend() {
  const parts = [], shades = map => `background:linear-gradient(to right,${data.maps[map].filter((_, i) => i % 7 === 0).join(",")})`;
  const bar = (before, map, after, marker) => {
    const made = element("span");
    made.append(GLYPHS[marker], ` ${before}`, element("i", "", {style: shades(map)}), after);
    return made;
  };
  if (measure.words) {
    const there = new Set(state.visible.map(i => measure.x[i]));
    measure.words.forEach((word, k) => there.has(k) && parts.push(entry(word, measure.fills[k], measure.markers[k])));
  } else {
    const shown = measure.bad ? [["unstable, ", measure.unstableEnds, "YlOrBr", "square"], ["stable, ", measure.stableEnds, "Blues", "circle"]] : [["", measure.ends, "viridis", "circle"]];
    for (const [words, ends, map, marker] of shown) {
      if (ends[0] > ends[1]) continue;  // none of them
      const [pale, dark] = measure.bad ? [...ends].sort((a, b) => Math.abs(a) - Math.abs(b)) : ends;
      const near = Math.abs(pale) <= 1e-5 * Math.abs(dark) ? 0 : pale;  // round-off
      parts.push(bar(words + digits(near, 3), map, inUnit(`to ${digits(dark, 3)}`, measure.unit), marker));
    }
  }
  if (!measure.words && state.visible.some(i => isNaN(measure.x[i]))) parts.push(entry("not known", data.grey, "x"));
  if (state.visible.some(unknown)) parts.push(entry(`no ${measureOf(state.up).name} known: at the lower edge`, data.grey, "inverted_triangle"));
  fill($("legend"), element("span", `${measure.name}:`), ...parts);
}
function mapMove(right, up) {
  const {plot} = figures.map, {x, y} = state, here = state.point;
  const wide = plot.x_range.end - plot.x_range.start, high = plot.y_range.end - plot.y_range.start;
  let best = -1, least = Infinity;
  for (const i of state.visible) {
    const dx = (x[i] - x[here]) / wide, dy = (y[i] - y[here]) / high;
    const ahead = right ? right * dx : up * dy, aside = Math.abs(right ? dy : dx);
    if (ahead > 1e-9 && ahead + 4 * aside < least) { least = ahead + 4 * aside; best = i; }
  }
  if (best >= 0) choose(best);
}
