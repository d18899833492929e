// Plays the recording embedded in the page.
import { makePlots } from 'plots';
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
const plots = makePlots(scene, state, (time) => { setPlaying(false); seek(frameAt(time)); });

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
  plots.add(`${cell !== undefined ? cellName(cell) : objectName(id)}, ${name}`, of);
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
for (const { name, values } of scene.plots) plots.add(name, (f) => values[f] ?? NaN);
if (series.position && scene.objects.length > 0)
  plots.add('mean speed, u/s', (f) => {
    const speeds = scene.objects.map((_, id) => speedOf(f, id)).filter(Number.isFinite);
    return speeds.reduce((a, b) => a + b, 0) / speeds.length;
  });
showPlots(plots.count() > 0 && window.innerWidth >= 900);
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
    if (!byId('plots').hidden) plots.draw(state.frame);
    state.shown = state.frame;
  }
  table.draw(state.frame);
});
state.ready = true;
