// Limit cycles: verdicts of the modes of a design point, and levels along a parameter.
const own = data.own, STABLE = 1, RUN = 3;
const tables = {};
for (const name of ["verdicts", "cycles", "branches"]) {
  tables[name] = Object.fromEntries(Object.entries(own[name]).map(([key, value]) => [key, value && value.text ? numbers(value) : value]));
}
const {verdicts, cycles, branches} = tables;
const QUANTITIES = [["torque_rms", `RMS [${own.unit}]`], ["frequency_hz", "frequency [Hz]"], ["contact_velocity", "contact velocity [m/s]"]];
const HEADS = ["mode", "frequency Hz", "growth 1/s", "verdict", `RMS ${own.unit}`, "error", "least known kick m/s"];
const [unstableColour, stableColour] = data.colours;
const cycleLook = i => cycles.stable[i] === STABLE ? [stableColour, "circle"] : cycles.stable[i] === 0 ? ["#FFFFFF", "diamond"] : cycles.stable[i] === RUN ? ["#000000", "x"] : [data.grey, "triangle"];

const percent = share => !Number.isFinite(share) ? "-" : share < 1e-5 ? "< 0.001 %" : `${digits(100 * share, 2)} %`;

detail.start = () => {
  fill($("modes-head"), element("tr"));
  $("modes-head").firstChild.append(...HEADS.map(text => element("th", text, {scope: "col"})));
  options($("quantity"), QUANTITIES, "torque_rms");
  alongControls(() => drawLine());
  $("quantity").onchange = () => drawLine();
  handlers.line = {tap: i => choose(cycles.row[state.cycles[i]]), text: i => cycleText(state.cycles[i])};
  fill($("line-legend"), entry("stable cycle", stableColour, "circle"), entry("unstable cycle: motions grow from a kick beyond it", "#FFFFFF", "diamond"),
    entry("stability not known", data.grey, "triangle"), entry("of a run in time", "#000000", "x"));
};
function cycleText(i) {
  const state = cycles.stable[i] === STABLE ? "stable" : cycles.stable[i] === 0 ? "unstable" : "not known whether stable";
  return [atText(cycles.row[i]), cycles.stable[i] === RUN ? `mode ${cycles.mode[i]}, motion of a run in time` : `mode ${cycles.mode[i]}, ${state} cycle`, `RMS ${digits(cycles.torque_rms[i])} ${own.unit}, error ${percent(cycles.level_error[i])}`,
    `${digits(cycles.frequency_hz[i], 5)} Hz, contact velocity ${digits(cycles.contact_velocity[i])} m/s`].join("\n");
}
detail.said = knownMeasures;
detail.point = row => {
  const rows = [];
  verdicts.row.forEach((at, i) => { if (at === row) rows.push(i); });
  fill($("modes"), ...rows.flatMap(i => {
    const made = element("tr"), kick = Math.min(...[verdicts.threshold_velocity[i], verdicts.kick_velocity[i]].filter(Number.isFinite));
    const texts = [verdicts.mode[i], digits(verdicts.frequency_hz[i]), digits(verdicts.growth_rate[i]), verdicts.verdict[i].replaceAll("_", " "),
      digits(verdicts.torque_rms[i]), percent(verdicts.level_error[i]), digits(kick)];
    made.append(...texts.map(text => element("td", text)));
    const why = element("tr");
    why.append(element("td", verdicts.reason[i], {class: "wide", colspan: HEADS.length}));
    return [made, why];
  }));
  drawLine();
};
function drawLine() {
  const along = named($("along").value), {plot, source} = figures.line, quantity = $("quantity").value;
  placeSlider(along);
  const there = new Set(state.line), at = row => along ? along.x[row] * along.factor : points.rows[row];
  const dots = {x: [], y: [], fill: [], line: [], size: [], marker: []};
  state.cycles = [];
  for (let i = 0; i < cycles.n; i++) {
    if (!there.has(cycles.row[i]) || !Number.isFinite(cycles[quantity][i])) continue;
    const [colour, marker] = cycleLook(i);
    dots.x.push(at(cycles.row[i])); dots.y.push(cycles[quantity][i]); dots.fill.push(colour);
    dots.line.push(cycles.stable[i] === 0 ? unstableColour : colour); dots.size.push(11); dots.marker.push(marker);
    state.cycles.push(i);
  }
  const lines = {xs: [], ys: [], colour: [], width: [], dash: []};
  let last = "";
  for (let i = 0; i < branches.n; i++) {
    if (!along || branches.along[i] !== along.name || !there.has(branches.row[i])) continue;
    const key = `${branches.row[i]} ${branches.cycle_id[i]} ${branches.stable[i]}`, stable = branches.stable[i] === STABLE;
    if (key !== last) {
      lines.xs.push([]); lines.ys.push([]); lines.width.push(2);
      lines.colour.push(stable ? stableColour : branches.stable[i] === 0 ? unstableColour : data.grey);
      lines.dash.push(stable ? "solid" : "dashed");
    }
    last = key;
    lines.xs.at(-1).push(branches.value[i] * along.factor); lines.ys.at(-1).push(branches[quantity][i]);
  }
  source("lines").data = lines;
  source("points").data = dots;
  source("here").location = at(state.point);
  source("zero").visible = quantity !== "frequency_hz";
  plot.below[0].axis_label = plainText(along ? along.label : "number of the point");
  plot.left[0].axis_label = plainText(QUANTITIES.find(([key]) => key === quantity)[1]);
  limits(plot.x_range, ...padded(along ? along.distinct.map(v => v * along.factor) : [points.rows[state.point]]));
  const heights = padded([...dots.y, ...lines.ys.flat(), ...(quantity === "frequency_hz" ? [] : [0])]);
  limits(plot.y_range, ...heights);
  const others = parameters.filter(p => p !== along);
  $("line-note").textContent = !dots.x.length ? `No ${QUANTITIES.find(([key]) => key === quantity)[1].split(" [")[0]} of a cycle is known at these design points.` :
    `${state.line.length} design point${state.line.length > 1 ? "s" : ""}${others.length ? ` at ${atText(state.point, others)}` : ""}.`;
}
