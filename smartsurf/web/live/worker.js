// Runs the simulation and the program in the live page's worker. The page ends the worker of a script that does not answer.
// `makeLive` is emscripten's; see Live.cpp for the functions.
const kSlice_ms = 24, kFrameEvery_ms = 30;
let live, started = false, speed = 0, behind_s = 0, last_ms = 0, drawn = true, frameAt_ms = 0, objects = 0, scheduled = false;

const text = (name, ...given) => live.ccall(name, 'string', given.map(() => 'string'), given);
const say = (stream) => (line) => postMessage({ [stream]: line });

function sendScene() {
  objects = live._live_objects();
  postMessage({ scene: text('live_scene') });
}

function sendFrame() {
  if (live._live_objects() !== objects) sendScene();
  const at = live._live_frame() >> 2, frame = live.HEAPF32.slice(at, at + live._live_frame_size());
  drawn = false;
  frameAt_ms = performance.now();
  postMessage({ frame, time: live._live_time() }, [frame.buffer]);
}

// Returns whether it goes on.
function tick() {
  const status = live._live_tick();
  if (status === 0) return true;
  speed = 0;
  sendFrame();
  postMessage({ [status === 1 ? 'ended' : 'error']: text('live_message'), time: live._live_time() });
  return false;
}

function schedule(ms) {
  if (scheduled) return;
  scheduled = true;
  setTimeout(advance, ms);
}

function advance() {
  scheduled = false;
  if (speed === 0) return;
  const now = performance.now();
  // On a slow machine the backlog is bounded, and the simulation falls behind real time.
  behind_s = Math.min(behind_s + (now - last_ms) / 1000 * speed, 0.1 * Math.max(speed, 1));
  last_ms = now;
  const period = live.period;
  while (behind_s >= period && performance.now() - now < kSlice_ms) {
    if (!tick()) return;
    behind_s -= period;
  }
  if (drawn && performance.now() - frameAt_ms >= kFrameEvery_ms) sendFrame();
  schedule(behind_s >= period ? 0 : 4);
}

function write(files) {
  for (const [path, content] of Object.entries(files)) {
    live.FS.mkdirTree('/' + path.split('/').slice(0, -1).join('/'));
    live.FS.writeFile('/' + path, content);
  }
}

const orders = {
  async load({ module, files }) {
    live = await makeLive({
      instantiateWasm(imports, done) {
        WebAssembly.instantiate(module, imports).then((instance) => done(instance, module));
        return {};
      },
      print: say('output'), printErr: say('output'),
    });
    live.FS.chdir('/');
    write(files);
    postMessage({ loaded: true });
  },
  start({ files, experiment, program, seed, overrides }) {
    speed = 0;
    started = false;
    write(files);
    const error = text('live_start', experiment, program, seed, overrides ?? '');
    if (error) return postMessage({ error });
    started = true;
    const scene = text('live_scene');
    live.period = JSON.parse(scene).period;
    objects = live._live_objects();
    postMessage({ scene, started: true });
    sendFrame();
  },
  run({ factor }) {
    if (!started) return;
    speed = factor;
    behind_s = 0;
    last_ms = performance.now();
    schedule(0);
  },
  step() {
    if (started && tick()) sendFrame();
  },
  drawn() { drawn = true; },
  // As fast as possible to a simulated time; for tests.
  until({ seconds }) {
    speed = 0;
    if (!started) return;
    for (let more = true; more && live._live_time() < seconds - 1e-9;) more = live._live_tick() === 0;
    postMessage({ hash: text('live_hash'), time: live._live_time(), message: text('live_message') });
  },
};

onmessage = ({ data: { order, ...given } }) => orders[order](given);
