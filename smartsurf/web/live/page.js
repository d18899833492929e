// The live page: edits an experiment and its program, runs them in a worker and shows the table.
import { makeRenderer, makeTable } from 'table';

const kSilence_ms = 8000;   // after which a script that does not answer may be ended
const byId = (id) => document.getElementById(id);
const experiments = JSON.parse(byId('experiments').textContent), files = JSON.parse(byId('files').textContent);
const state = { view: 'iso', dark: false, selected: null, shown: -1, running: false, time: 0, ready: false, errors: [] };
window.live = state;   // for tests

// ---- The module, once for all workers
async function unpack(id) {
  const packed = Uint8Array.from(atob(byId(id).textContent), (c) => c.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip')));
}
const glue = await (await unpack('glue')).text();
const workerUrl = URL.createObjectURL(new Blob([glue, '\n', byId('worker').textContent], { type: 'text/javascript' }));
const compiled = WebAssembly.compile(await (await unpack('wasm')).arrayBuffer());

// ---- Frames: the arrays of the latest one, with the player's accessors
const series = {};
function setSeries(list) {
  const known = new Set(list.map(({ name }) => name));
  for (const name of Object.keys(series)) if (!known.has(name)) delete series[name];
  let offset = 0;
  for (const { name, unit, low, high, values } of list) {
    series[name] ??= {
      value(_, i) { return this.data[i]; },
      missing(_, i) { return Number.isNaN(this.data[i]); },
    };
    Object.assign(series[name], { name, unit, low, high, values, offset, data: new Float32Array(values).fill(NaN) });
    offset += values;
  }
}
function setFrame(frame) {
  for (const one of Object.values(series)) one.data = frame.subarray(one.offset, one.offset + one.values);
}

// ---- The table
const renderer = makeRenderer();
let table = null, scene = null, surface = '';
function setScene(next) {
  const { objects, seed, series: list, ...rest } = next, same = JSON.stringify([rest, list.map(({ name }) => name)
    .filter((name) => name !== 'position' && name !== 'orientation')]);
  setSeries(list);
  next.time = [0];
  if (table && same === surface) {
    table.setObjects(objects);
  } else {
    const cells = byId('cells').value;
    table?.dispose();
    for (const name of Object.keys(series)) delete series[name];
    setSeries(list);
    table = makeTable(next, series, renderer, state);
    byId('cells').value = [...byId('cells').options].some(({ value }) => value === cells) ? cells : '';
    state.selected = null;
    byId('inspect').hidden = true;
    state.view ??= 'iso';
    table.resize();
    table.setColours();
    table.grid.visible = byId('grid').checked;
  }
  surface = same;
  scene = next;
  state.scene = next;
  table.showLegend();
  showFacts();
}
function showFacts() {
  const n = scene.objects.length;
  byId('facts').textContent = `${scene.rows} × ${scene.columns} cells, ${n} object${n === 1 ? '' : 's'}, seed ${scene.seed}`;
}

// ---- What the programs say
function say(line, kind = '') {
  const entry = document.createElement('div');
  entry.textContent = line;
  entry.className = kind;
  byId('output').append(entry);
  while (byId('output').childElementCount > 200) byId('output').firstChild.remove();
  byId('output').scrollTop = byId('output').scrollHeight;
  if (kind === 'error') state.errors.push(line);
}

// ---- The worker
let worker = null, waiting = null, heard_ms = 0, hasFrame = false;
function send(order, given = {}) {
  worker.postMessage({ order, ...given });
}
const answers = {
  loaded() { begin(); },
  scene: (text) => setScene(JSON.parse(text)),
  started() { if (state.running) send('run', { factor: factor() }); },
  frame(frame, { time }) {
    setFrame(frame);
    hasFrame = true;
    state.time = time;
    state.shown = -1;
  },
  output: (line) => say(line),
  error(line) {
    say(line, 'error');
    setRunning(false);
  },
  ended(message, { time }) {
    say(`${message}, ${time.toFixed(2)} s`);
    setRunning(false);
    state.ended = true;
  },
  hash(hash, { time, message }) { state.hash = { hash, time, message }; },
};
async function startWorker() {
  worker?.terminate();
  worker = new Worker(workerUrl);
  heard_ms = performance.now();
  worker.onmessage = ({ data }) => {
    heard_ms = performance.now();
    byId('stop').hidden = true;
    for (const [name, handle] of Object.entries(answers)) if (name in data) handle(data[name], data);
  };
  worker.onerror = ({ message }) => {
    say(message || 'the simulation has crashed', 'error');
    setRunning(false);
    startWorker();
  };
  waiting = null;
  send('load', { module: await compiled, files });
}
// Begins the run, once the worker has loaded the module.
function begin() {
  state.ready = true;
  if (waiting) send('start', waiting);
  waiting = null;
}

const factor = () => Number(byId('speed').value);
function setRunning(running) {
  state.running = running;
  byId('play').textContent = running ? 'Pause' : 'Run';
}
function start() {
  const one = experiments[byId('experiment').value];
  byId('output').replaceChildren();
  state.errors = [];
  state.ended = false;
  state.hash = null;
  const program = byId('program').value.trim() ? one.program ?? one.experiment.replace(/[.]lua$/, '.aps') : '';
  byId('program-name').textContent = program || 'no program';
  state.time = 0;
  const given = { experiment: one.experiment, program, seed: byId('seed').value.trim(),
    files: { [one.experiment]: byId('script').value, ...(program ? { [program]: byId('program').value } : {}) } };
  if (state.ready) send('start', given); else waiting = given;
}
function choose() {
  const one = experiments[byId('experiment').value];
  byId('script').value = files[one.experiment];
  byId('program').value = one.program ? files[one.program] : '';
  byId('script-name').textContent = one.experiment;
  byId('seed').value = one.seed;
  setRunning(true);
  start();
}

byId('experiment').append(...experiments.map(({ title }, i) => new Option(title, i)));
byId('experiment').addEventListener('change', choose);
byId('apply').addEventListener('click', () => { setRunning(true); start(); });
byId('reset').addEventListener('click', start);
byId('play').addEventListener('click', () => {
  if (state.ended && !state.running) start();
  setRunning(!state.running);
  send('run', { factor: state.running ? factor() : 0 });
});
byId('step').addEventListener('click', () => {
  setRunning(false);
  send('run', { factor: 0 });
  send('step');
});
byId('stop').addEventListener('click', () => {
  state.ready = false;
  setRunning(false);
  startWorker();
  byId('stop').hidden = true;
  state.ended = true;
  say('ended: the script did not answer', 'error');
});
byId('speed').addEventListener('change', () => { if (state.running) send('run', { factor: factor() }); });
byId('cells').addEventListener('change', () => table?.showLegend());
for (const view of ['top', 'iso', 'side']) byId(`view-${view}`).addEventListener('click', () => table?.frameTable(view));
byId('grid').addEventListener('change', () => { if (table) table.grid.visible = byId('grid').checked; });
byId('editor-toggle').addEventListener('click', () => document.body.classList.toggle('narrow'));
for (const id of ['script', 'program'])
  byId(id).addEventListener('keydown', (event) => {
    if (event.key !== 'Enter' || !(event.ctrlKey || event.metaKey)) return;
    event.preventDefault();
    byId('apply').click();
  });
let pressed = null;
renderer.domElement.addEventListener('pointerdown', (event) => { pressed = [event.clientX, event.clientY]; });
renderer.domElement.addEventListener('pointerup', (event) => {
  const moved = pressed ? Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) : Infinity;
  if (table && event.button === 0 && moved < 4) table.select(event.clientX, event.clientY);
});
new ResizeObserver(() => table?.resize()).observe(byId('scene-area'));
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => table?.setColours());

// For tests: runs the menu's experiment up to a simulated time and sets state.hash.
state.until = (index, seed, seconds) => {
  byId('experiment').value = index;
  choose();
  byId('seed').value = seed;
  setRunning(false);
  start();
  send('until', { seconds });
};

// ---- Drawing, and the speed of the last second
let measured = { ms: performance.now(), time: 0 };
function showClock(now) {
  if (now - measured.ms > 1000 || state.time < measured.time) {
    const times = (state.time - measured.time) / (now - measured.ms) * 1000;
    byId('pace').textContent = state.running && times > 0 ? `${times.toPrecision(2)}× real time` : '';
    measured = { ms: now, time: state.time };
  }
  byId('clock').textContent = `${state.time.toFixed(2)} s`;
}
renderer.setAnimationLoop((now) => {
  if (state.running && performance.now() - heard_ms > kSilence_ms) byId('stop').hidden = false;
  if (!table || !hasFrame) return;
  if (state.shown !== 0) {
    table.show(0);
    state.shown = 0;
    send('drawn');
  }
  showClock(now);
  table.draw(0);
});
await startWorker();
choose();
