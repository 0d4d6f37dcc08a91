// Runs in time: the history of a design point, with zoom, and sound where every row is there.
const own = data.own;
const SOUND_HZ = 48000, LONGEST_SOUND = 60;  // sound card; seconds
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
  $("sound").hidden = $("slower-label").hidden = !shown || kept.rows_a_part > 1 || !kept.shows_motion;
  $("sound-note").textContent = shown && !kept.shows_motion ? "No sound: the motion is too fast for the rows that are kept; a lower save_every keeps more."
    : shown && kept.rows_a_part > 1 ? "No sound: not every row is on this page."
    : shown ? `Plays ${own.what}, at full loudness however large it is.` : "";
  if (!shown) {
    $("history-note").textContent = own.left.includes(row) ? "The history of this run is not on this page: it found no room, or cannot be read."
      : points.status.length && points.status[row] !== "ok" ? "No history of this run is kept: it failed."
      : "No history of this run is kept: [transient] save_every above 0 keeps them.";
    return;
  }
  limits(plot.x_range, shown.x[0], shown.x.at(-1));
  limits(plot.y_range, ...padded(shown.y));
  ends();
  const of = kept.rows_a_part > 1 ? `of every ${kept.rows_a_part} values` : "of the steps from row to row";
  const each = kept.rows_a_part > 1 || !kept.shows_motion ? `The smallest and the largest ${of} are drawn. ` : "";
  $("history-note").textContent = `${kept.n} rows are kept. ${each}Values are rounded by at most ${digits(kept.torque.error, 2)} ${own.unit}.`;
};
// What is shown as samples of a sound: means of rows where rows are closer than samples, else on the
// straight line between two rows; about their mean, the largest 1.
function samples(start, end, slower) {
  const {x, y} = shown, n = Math.floor((end - start) * slower * SOUND_HZ), out = new Float32Array(n);
  const step = 1 / (slower * SOUND_HZ);
  let row = 0, sum = 0;
  for (let k = 0; k < n; k++) {
    const from = start + k * step;
    while (row < x.length - 1 && x[row] < from) row++;
    let last = row, total = 0;
    while (last < x.length && x[last] < from + step) total += y[last++];
    const low = Math.max(row - 1, 0), gap = x[row] - x[low];
    out[k] = last > row ? total / (last - row) : gap > 0 ? y[low] + (y[row] - y[low]) * (from - x[low]) / gap : y[row];
    sum += out[k];
  }
  let largest = 1e-300;
  for (const v of out) largest = Math.max(largest, Math.abs(v - sum / n));
  return out.map(v => (v - sum / n) / largest);
}
function play() {
  const range = figures.history.plot.x_range, slower = +$("slower").value;
  const start = Math.max(range.start, shown.x[0]), end = Math.min(range.end, shown.x.at(-1), start + LONGEST_SOUND / slower);
  const sound = end > start ? samples(start, end, slower) : [];
  if (sound.length < 2) {
    $("sound-note").textContent = "Too short to play: show more of the run, or play it slower.";
    return;
  }
  const audio = new AudioContext(), buffer = audio.createBuffer(1, sound.length, SOUND_HZ);
  buffer.getChannelData(0).set(sound);
  const player = audio.createBufferSource();
  player.buffer = buffer;
  player.connect(audio.destination);
  player.onended = () => audio.close();
  player.start();
  const speed = slower > 1 ? `, slower by ${slower}: 1000 Hz sound as ${1000 / slower} Hz` : ", as fast as the run";
  $("sound-note").textContent = `Plays ${own.what} from ${digits(start, 4)} to ${digits(end, 4)} s${speed}. ` +
    "Its mean is left out and its largest value is full loudness: it does not tell how loud the brake is. " +
    `It has ${SOUND_HZ} samples a second, made from the rows.`;
}
