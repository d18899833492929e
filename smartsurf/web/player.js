// Plays the recording embedded in the page.
import { makeRenderer, makeTable } from 'table';

const byId = (id) => document.getElementById(id);
const scene = JSON.parse(byId('scene').textContent);

// ---- Frames. Arrays are stored one after another. Each frame is the difference from the previous one, all
// low bytes before all higher ones. See SeriesEncoder.h.
async function unpack() {
  const text = atob(byId('frames').textContent);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const series = {};
  let at = 0;
  for (const layout of scene.series) {
    const frames = scene.time.length, n = layout.values;
    const all = new { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array }[layout.bytes](frames * n);
    for (let f = 0; f < frames; ++f, at += n * layout.bytes)
      for (let i = 0; i < n; ++i) {
        let change = 0;
        for (let b = 0; b < layout.bytes; ++b) change |= bytes[at + b * n + i] << 8 * b;
        all[f * n + i] = change + (f > 0 ? all[(f - 1) * n + i] : 0);
      }
    const none = 2 ** (8 * layout.bytes) - 1;
    series[layout.name] = {
      ...layout, all, none, scale: (layout.high - layout.low) / (none - 1),
      value(f, i) { return this.low + this.all[f * n + i] * this.scale; },
      missing(f, i) { return this.all[f * n + i] === none; },
    };
  }
  return series;
}
const series = await unpack();

const state = { frame: 0, playing: true, now: scene.time[0], shown: -1, view: 'iso', dark: false, selected: null };
window.player = state;   // for tests
const renderer = makeRenderer(), table = makeTable(scene, series, renderer, state);
const { frameTable, quantities, cellName, objectName, speedOf } = table;

// ---- Plots beside the scene, over the whole recording; a drag in one moves the time
const plots = [];
function addPlot(name, of) {
  if (plots.some((plot) => plot.name === name)) return;
  const values = scene.time.map((_, f) => of(f)), known = values.filter(Number.isFinite);
  const low = known.reduce((a, b) => Math.min(a, b), Infinity), high = known.reduce((a, b) => Math.max(a, b), -Infinity);
  const figure = document.createElement('figure'), caption = document.createElement('figcaption');
  const title = document.createElement('span'), remove = document.createElement('button');
  title.textContent = name;
  remove.textContent = '×';
  remove.title = `remove ${name}`;
  caption.append(title, remove);
  const canvas = document.createElement('canvas');
  figure.append(caption, canvas);
  byId('plots').append(figure);
  const plot = { name, values, low: known.length ? low : 0, high: known.length ? high : 1, canvas };
  plots.push(plot);
  remove.addEventListener('click', () => {
    plots.splice(plots.indexOf(plot), 1);
    figure.remove();
  });
  const seekTo = (event) => {
    const box = canvas.getBoundingClientRect(), share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    setPlaying(false);
    seek(frameAt(scene.time[0] + share * (scene.time[last] - scene.time[0])));
  };
  canvas.addEventListener('pointerdown', (event) => { canvas.setPointerCapture(event.pointerId); seekTo(event); });
  canvas.addEventListener('pointermove', (event) => { if (event.buttons) seekTo(event); });
  state.shown = -1;
}

function drawPlot({ canvas, values, low, high }, frame) {
  const ratio = window.devicePixelRatio, width = canvas.clientWidth * ratio, height = canvas.clientHeight * ratio;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const plot = canvas.getContext('2d'), style = getComputedStyle(document.documentElement), line = 12 * ratio;
  const duration = scene.time[last] - scene.time[0] || 1, foot = height - line - 2 * ratio;
  const x = (f) => (scene.time[f] - scene.time[0]) / duration * (width - 2 * ratio) + ratio;
  const y = (value) => foot - 3 * ratio - (value - low) / (high - low || 1) * (foot - 6 * ratio);
  plot.clearRect(0, 0, width, height);
  plot.fillStyle = state.dark ? '#ffffff0d' : '#0000000a';
  plot.fillRect(0, 0, width, foot);
  plot.lineWidth = 1.5 * ratio;
  plot.strokeStyle = state.dark ? '#6cb6ff' : '#0b63b5';
  plot.beginPath();
  let drawing = false;
  values.forEach((value, f) => {
    if (!Number.isFinite(value)) { drawing = false; return; }
    if (drawing) plot.lineTo(x(f), y(value)); else plot.moveTo(x(f), y(value));
    drawing = true;
  });
  plot.stroke();
  plot.strokeStyle = '#d55e00';
  plot.strokeRect(x(frame), 0, 0, foot);
  plot.font = `${11 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
  plot.fillStyle = style.getPropertyValue('--dim');
  const number = (value) => String(Number(value.toPrecision(3)));
  plot.textAlign = 'left';
  plot.fillText(`${number(low)} to ${number(high)}`, 2 * ratio, height - 2 * ratio);
  plot.fillStyle = '#d55e00';
  plot.textAlign = 'right';
  plot.fillText(Number.isFinite(values[frame]) ? number(values[frame]) : '–', width - 2 * ratio, height - 2 * ratio);
}

// ---- Playback
const last = scene.time.length - 1;

function frameAt(time) {
  let low = 0, up = last;
  while (low < up) {
    const half = Math.ceil((low + up) / 2);
    if (scene.time[half] <= time + 1e-9) low = half; else up = half - 1;
  }
  return low;
}
function setPlaying(playing) {
  if (playing && state.frame === last) seek(0);
  state.playing = playing;
  byId('play').textContent = playing ? 'Pause' : 'Play';
}
function seek(frame) {
  state.frame = Math.min(Math.max(frame, 0), last);
  state.now = scene.time[state.frame];
}

byId('facts').textContent = `${scene.rows} × ${scene.columns} cells, ${scene.objects.length} object${scene.objects.length === 1 ? '' : 's'}${scene.seed === undefined ? '' : `, seed ${scene.seed}`}`;
byId('slider').max = last;
byId('slider').addEventListener('input', () => { setPlaying(false); seek(Number(byId('slider').value)); });
byId('play').addEventListener('click', () => setPlaying(!state.playing));
byId('back').addEventListener('click', () => { setPlaying(false); seek(state.frame - 1); });
byId('forward').addEventListener('click', () => { setPlaying(false); seek(state.frame + 1); });
byId('cells').addEventListener('change', table.showLegend);
for (const view of ['top', 'iso', 'side']) byId(`view-${view}`).addEventListener('click', () => frameTable(view));
byId('grid').addEventListener('change', () => { table.grid.visible = byId('grid').checked; });
byId('add-plot').addEventListener('click', () => {
  const { object: id, cell } = state.selected, { name, of } = quantities()[byId('quantity').value];
  addPlot(`${cell !== undefined ? cellName(cell) : objectName(id)}, ${name}`, of);
  showPlots(true);
});
byId('show-plots').addEventListener('change', () => showPlots(byId('show-plots').checked));
function showPlots(shown) {
  byId('show-plots').checked = shown;
  byId('plots').hidden = !shown;
  state.shown = -1;
}
byId('menu').addEventListener('click', () => {
  byId('menu').setAttribute('aria-expanded', byId('more').classList.toggle('open'));
});
let pressed = null;
renderer.domElement.addEventListener('pointerdown', (event) => { pressed = [event.clientX, event.clientY]; });
renderer.domElement.addEventListener('pointerup', (event) => {
  const moved = pressed ? Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) : Infinity;
  if (event.button === 0 && moved < 4) table.select(event.clientX, event.clientY);
});
window.addEventListener('keydown', (event) => {
  if (['SELECT', 'BUTTON', 'INPUT'].includes(event.target.tagName)) return;
  const views = { 1: 'top', 2: 'iso', 3: 'side' };
  if (views[event.key]) return frameTable(views[event.key]);
  const actions = { ' ': () => setPlaying(!state.playing), ArrowLeft: () => byId('back').click(), ArrowRight: () => byId('forward').click() };
  if (!actions[event.key]) return;
  event.preventDefault();
  actions[event.key]();
});
for (const { name, values } of scene.plots) addPlot(name, (f) => values[f] ?? NaN);
if (series.position && scene.objects.length > 0)
  addPlot('mean speed, u/s', (f) => {
    const speeds = scene.objects.map((_, id) => speedOf(f, id)).filter(Number.isFinite);
    return speeds.reduce((a, b) => a + b, 0) / speeds.length;
  });
showPlots(plots.length > 0 && window.innerWidth >= 900);
new ResizeObserver(table.resize).observe(byId('scene-area'));
table.resize();
table.setColours();
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', table.setColours);

let before = performance.now();
renderer.setAnimationLoop((now) => {
  const passed = Math.min((now - before) / 1000, 0.25);
  before = now;
  if (state.playing) {
    state.now += passed * Number(byId('speed').value);
    state.frame = frameAt(state.now);
    if (state.frame === last) setPlaying(false);
  }
  if (state.shown !== state.frame) {
    table.show(state.frame);
    byId('slider').value = state.frame;
    byId('clock').textContent = `${scene.time[state.frame].toFixed(2)} of ${scene.time[last].toFixed(2)} s`;
    if (!byId('plots').hidden) for (const plot of plots) drawPlot(plot, state.frame);
    state.shown = state.frame;
  }
  table.draw(state.frame);
});
state.ready = true;
