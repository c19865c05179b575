// Keeps the connection, keeps what the charts need, and draws when something new has come.

import { onLookChange } from './canvas.js';
import { WINDOW_SECONDS, drawErrors, drawForce, drawGait, drawPhi } from './charts.js';
import { setUpControls, showControls, showNotices } from './controls.js';
import { drawRig } from './rig.js';

const SILENT_MS = 1000;  // without news for so long the page no longer knows the state
const DEAD_MS = 4000;  // and after this it connects anew
const FIRST_WAIT_MS = 250, LONGEST_WAIT_MS = 4000;
const MOST_POINTS = 4000;  // however fast simulated time runs
const OLD_SECONDS = 1;  // what is older is greyed
const LATE_PAGE = 'late_page';  // of this page alone; all other states come from dcdrw live
const APART = 'M3 4c4 6 12 6 18 7M3 20c4-6 12-6 18-7', CLOCK = 'M12 3a9 9 0 1 0 .01 0M12 7v5l4 3';
const SIGNS = {
  synchronized: 'M3 13l6 6L21 5', converging: APART, lost: 'M3 7c6 0 12-1 18-4M3 17c6 0 12 1 18 4',
  slipped: 'M4 18h6v-6h6V6h5', stalled: 'M5 5h14v14H5z', held: 'M8 4v16M16 4v16', no_data: 'M4 4l16 16M20 4L4 20',
  late_data: CLOCK, [LATE_PAGE]: CLOCK,
};

const element = (id) => document.getElementById(id);
let socket = null, wait = FIRST_WAIT_MS, timer = 0, heardAt = -Infinity, scheduled = 0;
let kept, frame, frameAt, board, run;
let over = null;  // the earlier trial that is drawn beneath the live one

function forget() {
  kept = { phis: [], forces: [], falls: [] };
  frame = board = run = null;
}

function connect() {
  if (socket) return;
  const mine = socket = new WebSocket(`${location.protocol.replace('http', 'ws')}//${location.host}/ws`);
  let first = true;
  mine.onopen = () => later(reconnect, DEAD_MS);
  mine.onmessage = ({ data }) => {
    if (mine !== socket) return;
    if (first) forget();  // the first message brings all that the charts need
    const { age, frames } = JSON.parse(data);
    heardAt = performance.now() - 1000 * age;  // the server replays its last frames, also where no new ones come
    for (const news of frames) take(news, first);
    first = false;
    wait = FIRST_WAIT_MS;
    later(reconnect, DEAD_MS);
    schedule();
  };
  mine.onclose = () => mine === socket && reconnect();
}

function reconnect() {
  disconnect();
  watch();
  later(connect, wait * (0.75 + 0.5 * Math.random()));
  wait = Math.min(2 * wait, LONGEST_WAIT_MS);
}

function disconnect() {
  clearTimeout(timer);
  socket?.close();
  socket = null;
  heardAt = -Infinity;
}

// The one next step: to give up a silent connection, or to connect.
function later(step, delay) {
  clearTimeout(timer);
  timer = setTimeout(step, delay);
}

function take(news, old) {
  if (news.notices && !old) showNotices(news.notices);
  if (!news.state) return;
  if (news.run !== run) {  // the source has started anew
    run = news.run;
    kept = { phis: [], forces: [], falls: [] };
  }
  frame = news;
  frameAt = heardAt;
  if (news.board) board = news.board;
  for (const [name, list] of Object.entries(kept)) {
    list.push(...(news[name] || []));
    trim(list, name === 'falls' ? ([, t]) => t : ([t]) => t);
  }
}

// Drops what is older than the charts show; the stance before still shows.
function trim(list, time) {
  const start = now() - WINDOW_SECONDS - 3;
  const old = list.findIndex((item) => time(item) >= start);
  list.splice(0, Math.max(old, list.length - MOST_POINTS, 0));
}

const now = () => (kept.phis.length ? kept.phis.at(-1)[0] : 0);

// Draws once before the screen is next refreshed; not at all while nobody sees it.
function schedule() {
  cancelAnimationFrame(scheduled);
  scheduled = requestAnimationFrame(draw);
}

function draw() {
  watch();
  drawRig(frame && frame.rig, board);
  drawPhi(kept.phis, now(), board, sameWheels() && frame.start !== null ? { ...over, start: frame.start } : null);
  drawGait(kept.falls, now(), board);
  drawForce(kept.forces, now());
  drawErrors(board);
  if (board) showNodes(board.nodes);
}

const sameWheels = () => over && frame && board && JSON.stringify(over.wheels) === JSON.stringify(board.wheels);

// Whether the earlier trial lies beneath, or why it does not.
function showOver() {
  element('over').textContent = !over || !board ? ''
    : !sameWheels() ? 'which is of other wheels' : frame.start === null ? 'which waits for the start of a trial' : 'which lies beneath';
}

function offerOvers(trials) {
  const choice = element('choice');
  choice.replaceChildren(new Option('no earlier trial', -1), ...trials.map(({ name }, k) => new Option(name, k)));
  choice.onchange = () => { over = trials[choice.value] || null; schedule(); };
  choice.value = trials.length ? 0 : -1;
  choice.onchange();
  element('beneath').hidden = !trials.length;
}

// The state, its age and what may be done, from the last frame or from its absence.
function watch() {
  const silence = performance.now() - heardAt;
  if (frame && silence < SILENT_MS) {
    showState(frame.state, frame.detail);
    if (board) showControls(board);
  } else {
    showState(LATE_PAGE, 'this page hears nothing of dcdrw live; trying again …');
    showControls(board && { ...board, simulated: false, recorder: false, unknown: true });
  }
  showAge();
  showFigures(frame && frame.rig);
  showOver();
}

function showState(state, detail) {
  if (document.body.dataset.state !== state) {
    const word = state.replace('_', ' ').toUpperCase();
    document.body.dataset.state = state;
    element('state').textContent = word;
    document.title = `${word} – dcdrw live`;
  }
  element('sign').firstElementChild.setAttribute('d', SIGNS[state]);
  if (element('detail').textContent !== detail) element('detail').textContent = detail;
}

// How old the last sample is that is shown; where it is old, all that follows from it is greyed.
function showAge() {
  const age = frame && frame.age !== null ? frame.age + (performance.now() - frameAt) / 1000 : null;
  const late = document.body.dataset.state === LATE_PAGE;
  document.body.classList.toggle('old', late || age === null || age > OLD_SECONDS);
  element('age').textContent = age === null ? '' : `the last sample is ${age.toFixed(age < 10 ? 1 : 0)} s old`;
}

const counted = (count, thing) => `${count} ${thing}${count === 1 ? '' : 's'}`;
const signed = (value, digits) => (value < 0 ? '−' : '+') + Math.abs(value).toFixed(digits);

function showFigures(rig) {
  const known = Boolean(rig);
  element('error').textContent = known ? `${signed(rig.error_percent, 1)} %` : '–';
  element('phase').textContent = known ? `${rig.phase_percent.toFixed(1)} %` : '–';
  element('stride').textContent = known ? `${(rig.phase_percent / 2).toFixed(1)} % of a stride` : '';
  element('phi').textContent = known ? `${rig.phi_deg.toFixed(1)}°` : '–';
  element('goal').textContent = known && board ? `goal ${(board.pitch_deg / 2).toFixed(1)}°` : '';
  element('n').textContent = known ? signed(rig.n, 0).replace('+0', '0') : '–';
  element('steps').textContent = known && board ? counted(board.steps, 'step') : '';
  element('force').textContent = known && rig.force !== null
    ? `${signed(rig.force, 1)} N, ${rig.force < 0 ? 'compression' : 'tension'}` : '[N]';
  if (!board) return;
  element('slope').textContent = `on a slope of ${(board.slope * 180 / Math.PI).toFixed(2)}°`;
  element('ratio').textContent = board.ratio === null ? '[%]' : `[%], a step leaves ${(100 * board.ratio).toFixed(0)} %`;
  element('rate').textContent = known && board.rate ? `${counted(board.rate, 'sample')} per second${board.left_out}` : '';
}

const MARKS = { OK: '✓', WARN: '!', ERROR: '✕', STALE: '?' };
let shownNodes = '';

function showNodes(nodes) {
  const text = JSON.stringify(nodes);
  if (text === shownNodes || !nodes.length) return;
  shownNodes = text;
  element('nodes').replaceChildren(...nodes.map(({ name, level, message }) => {
    const item = document.createElement('li');
    item.className = level;
    for (const [kind, content] of [['mark', MARKS[level]], ['name', name], ['message', message]]) {
      const part = document.createElement('span');
      part.className = kind;
      part.textContent = content;
      item.append(part);
    }
    item.querySelector('.mark').setAttribute('aria-label', level);
    return item;
  }));
}

forget();
fetch('over.json').then((answer) => answer.json()).then(offerOvers);
setUpControls((command) => {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
});
if (location.search) history.replaceState(null, '', location.pathname);  // the cookie knows the token now
onLookChange(schedule);
setInterval(watch, 250);
document.addEventListener('visibilitychange', () => document.hidden || schedule());
// A browser cuts the socket that a frozen page, or one kept for its back button, leaves open, and reports a failure.
document.addEventListener('freeze', disconnect);
document.addEventListener('resume', connect);
addEventListener('pagehide', disconnect);
addEventListener('pageshow', connect);  // also when it is shown for the first time
