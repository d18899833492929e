// Plots beside the scene, over the whole recording.
import { numberText } from 'table';

// The frames that show a series in columns of pixels: of each column the first, least, greatest and last one. Values that are not
// finite divide them into pieces.
export function visiblePieces(values, columnOf) {
  const pieces = [];
  let piece = null, shown = null, column = 0;
  const finishColumn = () => {
    if (shown) piece.push(...new Set(shown.sort((a, b) => a - b)));
    shown = null;
  };
  values.forEach((value, f) => {
    if (!Number.isFinite(value)) {
      finishColumn();
      piece = null;
      return;
    }
    if (!piece) pieces.push(piece = []);
    if (shown && columnOf(f) === column) {
      if (value < values[shown[1]]) shown[1] = f;
      if (value > values[shown[2]]) shown[2] = f;
      shown[3] = f;
      return;
    }
    finishColumn();
    shown = [f, f, f, f];
    column = columnOf(f);
  });
  finishColumn();
  return pieces;
}

// seek(time): a drag in a plot moves the time.
export function makePlots(scene, state, seek) {
  const plots = [], start = scene.time[0], duration = scene.time[scene.time.length - 1] - start;

  function add(name, of) {
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
    document.getElementById('plots').append(figure);
    const plot = { name, values, low: known.length ? low : 0, high: known.length ? high : 1, canvas,
      curve: document.createElement('canvas'), look: '' };
    plots.push(plot);
    remove.addEventListener('click', () => {
      plots.splice(plots.indexOf(plot), 1);
      figure.remove();
    });
    const seekTo = (event) => {
      const box = canvas.getBoundingClientRect(), share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
      seek(start + share * duration);
    };
    canvas.addEventListener('pointerdown', (event) => { canvas.setPointerCapture(event.pointerId); seekTo(event); });
    canvas.addEventListener('pointermove', (event) => { if (event.buttons) seekTo(event); });
    state.shown = -1;
  }

  function drawCurve({ curve, values, low, high }, width, foot, ratio, x) {
    Object.assign(curve, { width, height: foot });   // which also clears it
    const pen = curve.getContext('2d');
    const y = (value) => foot - 3 * ratio - (value - low) / (high - low || 1) * (foot - 6 * ratio);
    pen.fillStyle = state.dark ? '#ffffff0d' : '#0000000a';
    pen.fillRect(0, 0, width, foot);
    pen.lineWidth = 1.5 * ratio;
    pen.strokeStyle = state.dark ? '#6cb6ff' : '#0b63b5';
    pen.beginPath();
    for (const piece of visiblePieces(values, (f) => Math.floor(x(f))))
      piece.forEach((f, i) => { if (i > 0) pen.lineTo(x(f), y(values[f])); else pen.moveTo(x(f), y(values[f])); });
    pen.stroke();
  }

  // The curve, a walk over the whole recording, is drawn once for each size and colour scheme.
  function drawPlot(plot, frame) {
    const { canvas, curve, values, low, high } = plot, ratio = window.devicePixelRatio;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    const foot = Math.round(height - 14 * ratio), look = `${width} × ${height}, ${ratio}, ${state.dark}`;
    if (width <= 0 || foot <= 0) return;
    const x = (f) => (scene.time[f] - start) / (duration || 1) * (width - 2 * ratio) + ratio;
    if (plot.look !== look) {
      plot.look = look;
      Object.assign(canvas, { width, height });
      drawCurve(plot, width, foot, ratio, x);
    }
    const pen = canvas.getContext('2d'), line = height - 2 * ratio, gap = 8 * ratio;
    pen.clearRect(0, 0, width, height);
    pen.drawImage(curve, 0, 0);
    pen.lineWidth = 1.5 * ratio;
    pen.strokeStyle = '#d55e00';
    pen.strokeRect(x(frame), 0, 0, foot);
    pen.font = `${11 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
    const [from, to, now] = [low, high, values[frame]].map((value) => numberText(value, high - low));
    pen.fillStyle = '#d55e00';
    pen.textAlign = 'right';
    pen.fillText(now, width - 2 * ratio, line);
    pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--dim');
    pen.textAlign = 'left';
    pen.fillText(`${from} to ${to}`, 2 * ratio, line, Math.max(width - 4 * ratio - pen.measureText(now).width - gap, gap));
  }

  return { add, count: () => plots.length, draw(frame) { for (const plot of plots) drawPlot(plot, frame); } };
}
