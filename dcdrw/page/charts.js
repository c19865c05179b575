// Charts against time, the present at the right, and the error against steps.

import { begin, colour } from './canvas.js';

export const WINDOW_SECONDS = 20;
const SHORTEST_GAP = 0.05;  // [s]: a point comes each 0.02 s at most
const LEFT = 40, RIGHT = 10, BOTTOM = 16;

// Less time where there is less room, so that stances stay wide enough to read.
const windowOf = (width) => Math.max(6, Math.min(WINDOW_SECONDS, width / 40));

function frameOf(id, low, high, ticks, bottom = BOTTOM) {
  const drawing = begin(id);
  const { context, width, height } = drawing;
  const top = 6, right = width - RIGHT, floor = height - bottom;
  const y = (value) => floor - (value - low) / (high - low) * (floor - top);
  context.textAlign = 'right';
  context.textBaseline = 'middle';
  for (const tick of ticks) {
    context.strokeStyle = colour('grid');
    context.lineWidth = 1;
    line(context, [[LEFT, y(tick)], [right, y(tick)]]);
    context.fillStyle = colour('dim');
    context.fillText(String(tick).replace('-', '−'), LEFT - 6, y(tick));
  }
  return { ...drawing, y, top, right, floor };
}

function timeAxis(chart, now) {
  const { context, right, floor, top } = chart;
  const seconds = windowOf(right - LEFT);
  const x = (t) => right - (now - t) / seconds * (right - LEFT);
  context.fillStyle = colour('dim');
  context.textBaseline = 'top';
  for (let ago = 0; ago <= seconds; ago += seconds > 12 ? 5 : 2) {
    context.textAlign = ago ? 'center' : 'right';
    if (x(now - ago) > LEFT) context.fillText(ago ? `−${ago} s` : 'now', x(now - ago), floor + 3);
  }
  context.save();
  context.beginPath();
  context.rect(LEFT, top - 4, right - LEFT + 4, floor - top + 8);
  context.clip();
  return x;
}

function line(context, points) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

// A round step that gives about `count` ticks.
export function tickStep(span, count) {
  const rough = span / count, power = 10 ** Math.floor(Math.log10(rough));
  return power * ([1, 2, 5].find((factor) => factor * power >= rough) || 10);
}

function ticksBetween(low, high, count) {
  const step = tickStep(high - low, count), ticks = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) ticks.push(Number((i * step).toPrecision(6)));
  return ticks;
}

// The median time between points.
function usualStep(points) {
  const steps = points.slice(1).map(([t], i) => t - points[i][0]).sort((one, other) => one - other);
  return steps.length ? steps[steps.length >> 1] : 0;
}

// Beneath lies an earlier trial, from the start of this one on.
export function drawPhi(points, now, board, over) {
  const pitch = board ? board.pitch_deg : 30;
  const chart = frameOf('phi-canvas', 0, pitch, [0, pitch / 2, pitch].map((tick) => Number(tick.toFixed(1))));
  const { canvas, context, y, right } = chart;
  if (!board) return;
  const band = board.band_percent / 100 * pitch;
  context.fillStyle = colour('band');
  context.globalAlpha = 0.2;
  context.fillRect(LEFT, y(pitch / 2 + band), right - LEFT, y(pitch / 2 - band) - y(pitch / 2 + band));
  context.globalAlpha = 1;
  context.strokeStyle = colour('band');
  line(context, [[LEFT, y(pitch / 2)], [right, y(pitch / 2)]]);
  const x = timeAxis(chart, now);
  const wraps = ([, phi], [, last]) => Math.abs(phi - last) > pitch / 2;
  canvas.dataset.over = 0;
  if (over) {
    const seen = over.phis.map(([t, phi]) => [over.start + t, phi]).filter(([t]) => t > now - WINDOW_SECONDS && t <= now);
    canvas.dataset.over = seen.length;
    context.strokeStyle = colour('front');
    context.globalAlpha = 0.4;
    context.lineWidth = 4;
    for (const piece of pieces(seen, wraps)) line(context, piece.map(([t, phi]) => [x(t), y(phi)]));
    context.globalAlpha = 1;
  }
  context.strokeStyle = colour('ink');
  context.lineWidth = 2.2;
  for (const piece of pieces(points, wraps)) line(context, piece.map(([t, phi]) => [x(t), y(phi)]));
  const last = points.at(-1);
  if (last) {
    context.fillStyle = colour('ink');
    context.beginPath();
    context.arc(x(last[0]), y(last[1]), 4, 0, 7);
    context.fill();
  }
  context.restore();
  canvas.dataset.points = points.length;
}

// Cut where a gap in time or a jump must not be joined by a line.
export function* pieces(points, jumps) {
  const gap = Math.max(3 * usualStep(points), SHORTEST_GAP);
  let piece = [];
  for (const point of points) {
    const last = piece.at(-1);
    if (last && (point[0] - last[0] > gap || point[0] < last[0] || jumps(point, last))) {
      yield piece;
      piece = [];
    }
    piece.push(point);
  }
  if (piece.length) yield piece;
}

// Least and most force of each point's time, so that no peak is lost.
export function drawForce(points, now) {
  const low = Math.min(0, ...points.map(([, least]) => least));
  const high = Math.max(0, ...points.map(([, , most]) => most));
  const margin = Math.max(0.08 * (high - low), 1);
  const chart = frameOf('force-canvas', low - margin, high + margin, ticksBetween(low - margin, high + margin, 4));
  const { canvas, context, y, right, width, height } = chart;
  canvas.dataset.points = points.length;
  if (!points.length) {
    context.textAlign = 'center';
    context.fillStyle = colour('dim');
    context.fillText('the source does not tell the coupler force', width / 2, height / 2);
    return;
  }
  context.strokeStyle = colour('dim');
  line(context, [[LEFT, y(0)], [right, y(0)]]);
  const x = timeAxis(chart, now);
  context.strokeStyle = colour('ink');
  context.lineWidth = 1.6;
  for (const piece of pieces(points, () => false)) {
    line(context, piece.flatMap(([t, least, most]) => [[x(t), y(least)], [x(t), y(most)]]));
  }
  context.restore();
}

// One bar is one stance, from a footfall to that wheel's next; the legs alternate in shade. Faint: a footfall is missing.
export function drawGait(falls, now, board) {
  if (board && board.person) {
    drawFeet(falls, now);
    return;
  }
  const chart = frameOf('gait-canvas', 0, 1, []);
  const { canvas, context, floor, top } = chart;
  const tall = (floor - top) / 2;
  ['front', 'rear'].forEach((wheel, row) => {
    context.fillStyle = colour(wheel);
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    context.fillText(wheel, LEFT - 6, top + (row + 0.5) * tall);
  });
  const x = timeAxis(chart, now);
  ['front', 'rear'].forEach((wheel, row) => {
    const own = falls.filter(([name]) => name === wheel);
    context.fillStyle = colour(wheel);
    own.forEach(([, t, steps], i) => {
      const [, until, next] = own[i + 1] || [wheel, now, steps + 1];
      context.globalAlpha = next !== steps + 1 ? 0.12 : steps % 2 ? 0.9 : 0.38;
      context.fillRect(x(t), top + row * tall + 2, Math.max(x(until) - x(t), 1), tall - 5);
    });
    context.globalAlpha = 1;
  });
  context.restore();
  canvas.dataset.falls = falls.length;
}

// Hildebrand's diagram of the four feet, by their numbers: a wheel's strikes are of the left and the right foot in turn.
// Which of the robot's is left is decided by the first: the right rear foot (4) follows the left front one (1).
function drawFeet(falls, now) {
  const chart = frameOf('gait-canvas', 0, 1, []);
  const { canvas, context, floor, top } = chart;
  const tall = (floor - top) / 4;
  context.font = context.font.replace('12px', '10px');
  ['1 L', '2 R', '3 L', '4 R'].forEach((foot, row) => {
    context.fillStyle = colour(row < 2 ? 'front' : 'rear');
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    context.fillText(foot, LEFT - 4, top + (row + 0.5) * tall);
  });
  const x = timeAxis(chart, now);
  const second = falls.findIndex(([wheel], i) => wheel === 'rear' && falls.slice(0, i).some(([other]) => other === 'front'));
  const before = falls.slice(0, Math.max(second, 0)).findLast(([wheel]) => wheel === 'front');
  const side = before ? Math.abs(falls[second][2] + before[2] + 1) % 2 : 0;
  ['front', 'rear'].forEach((wheel, half) => {
    const own = falls.filter(([name]) => name === wheel);
    context.fillStyle = colour(wheel);
    own.forEach(([, t, steps], i) => {
      const [, until, next] = own[i + 1] || [wheel, now, steps + 1];
      const row = 2 * half + Math.abs(steps + half * side) % 2;
      context.globalAlpha = next !== steps + 1 ? 0.12 : 0.9;
      context.fillRect(x(t), top + row * tall + 2, Math.max(x(until) - x(t) - 1, 1), tall - 4);
    });
    context.globalAlpha = 1;
  });
  context.restore();
  canvas.dataset.falls = falls.length;
}

// A step that comes nearer to its goal is filled, one that goes away from it is hollow.
export function drawErrors(board) {
  const errors = board ? board.errors : [], band = board ? board.band_percent : 6;
  const most = Math.max(2 * band, ...errors.map(Math.abs)) * 1.1;
  const chart = frameOf('errors-canvas', -most, most, ticksBetween(-most, most, 5));
  const { canvas, context, y, right, floor, width, height } = chart;
  context.fillStyle = context.strokeStyle = colour('band');
  context.globalAlpha = 0.2;
  context.fillRect(LEFT, y(band), right - LEFT, y(-band) - y(band));
  context.globalAlpha = 1;
  line(context, [[LEFT, y(0)], [right, y(0)]]);
  canvas.dataset.steps = board ? board.steps : 0;
  canvas.dataset.shown = errors.length;
  context.textAlign = 'center';
  if (!errors.length) {
    context.fillStyle = colour('dim');
    context.fillText('no step yet', width / 2, height / 2 - 16);
    return;
  }
  const room = Math.max(errors.length, 12);
  const x = (i) => LEFT + (i + 0.7) / (room + 0.4) * (right - LEFT);
  const first = board.steps - errors.length + 1;  // the number of the first step shown
  context.fillStyle = colour('dim');
  context.textBaseline = 'top';
  const every = tickStep(room, (right - LEFT) / 55);
  for (let step = Math.ceil(Math.max(first, 1) / every) * every; step <= board.steps; step += every) {
    context.fillText(step, x(step - first), floor + 3);
  }
  context.strokeStyle = colour('dim');
  context.lineWidth = 1;
  line(context, errors.map((error, i) => [x(i), y(error)]));
  const radius = Math.max(2.5, Math.min(5, (right - LEFT) / room / 3));
  errors.forEach((error, i) => {
    const nearer = !i || Math.abs(error) <= Math.abs(errors[i - 1]) || Math.abs(error) <= band;
    context.beginPath();
    context.arc(x(i), y(error), radius, 0, 7);
    context.fillStyle = nearer ? colour(Math.abs(error) <= band ? 'band' : 'ink') : colour('card');
    context.strokeStyle = Math.abs(error) <= band ? colour('band') : colour('ink');
    context.lineWidth = 1.6;
    context.fill();
    context.stroke();
  });
}
