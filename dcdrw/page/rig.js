// The rig as the data say it stands: x runs down the slope, y along its normal.

import { begin, colour } from './canvas.js';

const TAU = 2 * Math.PI;

export function drawRig(rig, board) {
  const { canvas, context, width, height } = begin('rig-canvas');
  if (!rig || !board) return;
  const wheels = board.wheels.map(([length, spokes], i) => ({
    length, spokes, alpha: Math.PI / spokes, theta: rig.theta[i], leg: rig.legs[i],
    colour: colour(['front', 'rear'][i]),
  }));
  const [front, rear] = wheels;
  rear.foot = 0;
  front.foot = rig.S;
  for (const wheel of wheels) {  // the stance leg is θ from the normal
    wheel.x = wheel.foot + wheel.length * Math.sin(wheel.theta);
    wheel.y = wheel.length * Math.cos(wheel.theta);
  }
  const middle = (front.x + rear.x) / 2;
  const reach = Math.abs(front.x - rear.x) + front.length + rear.length;
  const tallest = 2 * Math.max(front.length, rear.length);
  const scale = Math.max(Math.min((height - 34) / (tallest * 1.04), (width - 24) / (reach * 1.06)), 1);  // while a layout settles there may be no room
  const ground = height - 20 - Math.min(40, (width / 2) * Math.abs(Math.tan(board.slope)) * 0.5);

  context.save();
  context.translate(width / 2, ground);
  context.rotate(board.slope);
  const at = (x, y) => [(x - middle) * scale, -y * scale];
  drawGround(context, rear, middle, rig.legs[1], width, scale);
  for (const wheel of [rear, front]) drawWheel(context, wheel, at, scale);
  drawCoupler(context, at(rear.x, rear.y), at(front.x, front.y));
  for (const wheel of wheels) {
    const [x, y] = at(wheel.x, wheel.y);
    context.fillStyle = wheel.colour;
    context.beginPath();
    context.arc(x, y, 6, 0, TAU);
    context.fill();
  }
  context.restore();

  context.textAlign = 'left';
  context.fillStyle = rear.colour;
  context.fillText('● rear', 4, 12);
  context.fillStyle = front.colour;
  context.fillText('● front', 56, 12);
  // What is drawn, for whoever reads the page by program.
  Object.assign(canvas.dataset, {
    stampNs: rig.stamp_ns, theta1: front.theta, theta2: rear.theta, n: rig.n,
    hubs: Math.hypot(front.x - rear.x, front.y - rear.y).toFixed(5),
    drawn: Number(canvas.dataset.drawn || 0) + 1,
  });
}

// Marks stand where the rear wheel's feet do, and so move past as it rolls.
function drawGround(context, rear, middle, steps, width, scale) {
  const step = 2 * rear.length * Math.sin(rear.alpha);
  const reach = width / scale;
  context.strokeStyle = colour('dim');
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(-width, 0);
  context.lineTo(width, 0);
  context.stroke();
  context.lineWidth = 1;
  context.beginPath();
  const first = Math.ceil((middle - reach) / step);
  for (let i = first; i * step < middle + reach; i++) {
    const x = (i * step - middle) * scale;
    const long = (((i + steps) % 6) + 6) % 6 === 0;
    context.moveTo(x, 0);
    context.lineTo(x - (long ? 7 : 4), long ? 14 : 7);
  }
  context.stroke();
}

function drawWheel(context, wheel, at, scale) {
  const count = Math.floor(wheel.spokes + 1e-9);
  const [hubX, hubY] = at(wheel.x, wheel.y);
  const foot = (j) => {  // of the spoke that stands in j steps
    const angle = wheel.theta - 2 * wheel.alpha * j;
    return at(wheel.x - wheel.length * Math.sin(angle), wheel.y - wheel.length * Math.cos(angle));
  };
  const marked = (((-wheel.leg) % count) + count) % count;
  context.strokeStyle = context.fillStyle = wheel.colour;
  context.globalAlpha = 0.22;
  context.lineWidth = 1;
  context.beginPath();
  context.arc(hubX, hubY, wheel.length * scale, 0, TAU);
  context.stroke();
  for (let j = 0; j < count; j++) {
    const [x, y] = foot(j);
    context.globalAlpha = j === 0 ? 1 : 0.6;
    context.lineWidth = j === 0 ? 6 : 1.8;
    context.beginPath();
    context.moveTo(hubX, hubY);
    context.lineTo(x, y);
    context.stroke();
    context.globalAlpha = 1;
    context.beginPath();
    context.arc(x, y, j === marked ? 5.5 : 2.2, 0, TAU);
    context.fill();
  }
}

// A spring and a damper side by side.
function drawCoupler(context, [x1, y1], [x2, y2]) {
  const length = Math.hypot(x2 - x1, y2 - y1);
  const end = Math.min(22, length * 0.16), body = length - 2 * end, half = 9;
  context.save();
  context.translate(x1, y1);
  context.rotate(Math.atan2(y2 - y1, x2 - x1));
  for (const [style, thickness] of [[colour('card'), 6], [colour('ink'), 2.2]]) {  // a rim, to stand out
    context.strokeStyle = style;
    context.lineWidth = thickness;
    context.beginPath();
    context.moveTo(0, 0);
    context.lineTo(end, 0);
    context.moveTo(end, -half);
    context.lineTo(end, half);
    context.moveTo(end, -half);
    const turns = 7;
    for (let i = 0; i < turns; i++) {
      context.lineTo(end + body * (i + 0.3) / turns, -half - 7);
      context.lineTo(end + body * (i + 0.7) / turns, -half + 7);
    }
    context.lineTo(end + body, -half);
    context.lineTo(end + body, half);
    context.moveTo(length, 0);
    context.lineTo(end + body, 0);
    context.moveTo(end + body, half);
    context.lineTo(length / 2, half);
    context.moveTo(length / 2, half - 5);
    context.lineTo(length / 2, half + 5);
    context.moveTo(length / 2 + 10, half - 8);
    context.lineTo(length / 2 - 10, half - 8);
    context.lineTo(length / 2 - 10, half + 8);
    context.lineTo(length / 2 + 10, half + 8);
    context.moveTo(length / 2 - 10, half);
    context.lineTo(end, half);
    context.stroke();
  }
  context.restore();
}
