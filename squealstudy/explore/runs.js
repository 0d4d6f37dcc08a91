// Runs in time: the history of a design point, with zoom, and sound where every row is there.
const own = data.own;
let shown = null;

detail.start = () => {
  figures.history.plot.left[0].axis_label = plainText(`${own.what} [${own.unit}]`);
  const range = figures.history.plot.x_range;
  for (const id of ["from", "to"]) $(id).onchange = () => {
    if (shown) range.setv({start: +$("from").value, end: +$("to").value});
  };
  $("whole").onclick = () => shown && limits(range, ...whole.get(range));
  for (const end of ["start", "end"]) range.properties[end].change.connect(ends);
  $("sound").onclick = play;
};
function ends() {
  const {start, end} = figures.history.plot.x_range;
  $("from").value = digits(Math.max(0, start), 6);
  $("to").value = digits(end, 6);
}
detail.said = knownMeasures;
detail.point = row => {
  const kept = own.histories[row], {plot, source} = figures.history;
  shown = kept ? {x: numbers(kept.time), y: numbers(kept.torque), ...kept} : null;
  source("points").data = shown ? {x: shown.x, y: shown.y} : {x: [], y: []};
  $("sound").hidden = !shown || kept.rows_a_part > 1 || !(rate() >= 8000 && rate() <= 96000);
  if (!shown) {
    $("history-note").textContent = "No history of this run is kept: [transient] save_every above 0 keeps them.";
    return;
  }
  limits(plot.x_range, shown.x[0], shown.x.at(-1));
  limits(plot.y_range, ...padded(shown.y));
  ends();
  const each = kept.rows_a_part > 1 ? `Of each ${kept.rows_a_part} rows the least and the largest value are drawn. ` : "";
  $("history-note").textContent = `${kept.n} rows are kept. ${each}Values are rounded by at most ${digits(kept.torque.error, 2)} ${own.unit}.`;
};
const rate = () => (shown.x.length - 1) / (shown.x.at(-1) - shown.x[0]);
function play() {
  const {start, end} = figures.history.plot.x_range;
  const part = [...shown.y].filter((_, i) => shown.x[i] >= start && shown.x[i] <= end);
  if (part.length < 2) return;
  const mean = part.reduce((a, b) => a + b, 0) / part.length;
  const largest = part.reduce((a, b) => Math.max(a, Math.abs(b - mean)), 1e-300);
  const audio = new AudioContext(), sound = audio.createBuffer(1, part.length, rate());
  sound.getChannelData(0).set(part.map(v => (v - mean) / largest));
  const player = audio.createBufferSource();
  player.buffer = sound;
  player.connect(audio.destination);
  player.onended = () => audio.close();
  player.start();
}
