// Runs an experiment with the live page's WebAssembly in Node, for tests and measurements: prints the hash of the state and
// the processor time as JSON.
//   node node.js LIVE.js SECONDS SEED EXPERIMENT.lua [PROGRAM.aps] [NAME=VALUE…]   in the folder that holds scripts/
const fs = require('fs');
const path = require('path');

const [glue, seconds, seed, experiment, ...rest] = process.argv.slice(2);
const program = rest.length > 0 && !rest[0].includes('=') ? rest.shift() : '';
const makeLive = require(path.resolve(glue));

(async () => {
  const live = await makeLive({ wasmBinary: fs.readFileSync(glue.replace(/[.]js$/, '.wasm')) });
  const text = (name, ...given) => live.ccall(name, 'string', given.map(() => 'string'), given);
  const put = (from, to) => {
    live.FS.mkdirTree(path.dirname(to));
    live.FS.writeFile(to, fs.readFileSync(from));
  };
  for (const folder of new Set([experiment, program].filter(Boolean).map((file) => path.dirname(file))))
    for (const file of fs.readdirSync(folder))
      if (/[.](lua|aps)$/.test(file)) put(path.join(folder, file), path.join('/', folder, file));
  for (const file of fs.readdirSync('scripts/apron')) if (file.endsWith('.aps')) put(path.join('scripts/apron', file), '/apron/' + file);
  live.FS.chdir('/');
  const error = text('live_start', experiment, program, seed, rest.join('\n'));
  if (error) {
    console.error(error);
    process.exit(2);
  }
  const before = process.cpuUsage();
  let status = 0;
  while (status === 0 && live._live_time() < seconds - 1e-9) status = live._live_tick();
  const used = process.cpuUsage(before);
  if (status === 2) console.error(text('live_message'));
  console.log(JSON.stringify({ hash: text('live_hash'), time: live._live_time(), status, cpu_s: (used.user + used.system) / 1e6 }));
})();
